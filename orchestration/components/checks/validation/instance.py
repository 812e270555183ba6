"""An instance of an FMU under validation, for any variable type and any order of calls."""

import ctypes
import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from orchestration.components.fmi.adapted import Adapted2, Adapted3, AdaptedInstance
from orchestration.components.fmi.fmi2 import Fmi2Instance
from orchestration.components.fmi.fmi3 import Fmi3Instance
from orchestration.components.fmi.native_instance import NativeInstance
from orchestration.components.fmi.read_description import Model, Variable
from orchestration.components.fmi.slaves import Message, failure_text, instantiates
from orchestration.foundation.basics.errors import SimulatorError, StoppedStepError
from orchestration.foundation.basics.simulator import Floats, Transfer

Value: TypeAlias = float | int | bool | str | bytes
Values: TypeAlias = Mapping[str, Value]
Row: TypeAlias = dict[str, Value]
"""Values by the names of the variables"""

Beat: TypeAlias = Callable[..., None]
"""Called when a call of the FMU begins or returns, and before a step with its time [s]"""

_CONVERT: Mapping[str, Callable[[float], Value]] = {
    "Real": float,
    "Integer": int,
    "Enumeration": int,
    "Boolean": bool,
}
"""Conversions of numbers, by kind"""
_MORE = 64
"""Numbers watched beyond those that an FMU is asked for"""


class CheckedInstance(NativeInstance):
    """One instance that is called as the rules say; it keeps all messages, and reports when a call begins or returns.

    Errors of its calls name the function without the instance.
    """

    reads_exactly = False

    def __init__(self, model: Model, folder: Path, name: str, beat: Beat) -> None:
        self._beat = beat
        self._transfers: dict[tuple[str, tuple[str, ...]], tuple[Floats, Transfer]] = {}
        beat()
        super().__init__(model.path, name, unpacked=folder)
        beat()

    @property
    def messages(self) -> Sequence[Message]:
        """All that it has logged."""
        return self._messages

    # -- a run ----------------------------------------------------------------------------------------------

    def begin(self, values: Values, start: float, stop: float | None = None) -> None:
        """Set parameters, enter initialisation mode, set inputs; `stop` is None if no stop time is defined."""
        inputs = {name: value for name, value in values.items() if self.variables[name].causality == "input"}
        self.put({name: value for name, value in values.items() if name not in inputs})
        self._enter(start, stop)
        self.put(inputs)

    def start(self, values: Values, start: float, stop: float | None = None) -> None:
        """Initialise the instance."""
        self.begin(values, start, stop)
        self.exit_initialization()

    def advance(self, t: float, h: float) -> bool:
        """Step from `t` to `t + h` seconds; False if the FMU ends the run."""
        self._beat(t)
        try:
            self.step(t, h)
        except StoppedStepError as stopped:
            if not stopped.ends:
                raise
            return False
        return True

    def terminate(self) -> None:
        """End the run."""
        self._call("terminate")

    def numbers_of_states(self) -> tuple[int, int]:
        """The numbers of its continuous states and event indicators, for model exchange."""
        return 0, 0

    def reset(self) -> None:
        """Return to the state after instantiation."""
        super().reset()
        self._transfers.clear()  # those of arrays have what was set before

    # -- values ---------------------------------------------------------------------------------------------

    def put(self, values: Values) -> None:
        """Set scalars, and elements of arrays, by name."""
        for name, value in values.items():
            if isinstance(value, (str, bytes)):
                v = self.variable(name)
                self._call(f"set{v.kind}", [v.reference], [value] * max(v.length, 1))
        numbers = {name: float(value) for name, value in values.items() if not isinstance(value, (str, bytes))}
        if numbers:
            array, write = self._transfer_of(self.writer, tuple(numbers))
            array[:] = list(numbers.values())
            write()

    def row(self, variables: Sequence[Variable]) -> Row:
        """The values of scalars and of elements of arrays; numbers are read by type."""
        numbers = {v.name: _CONVERT[v.kind] for v in variables if v.kind in _CONVERT}
        array, read = self._transfer_of(self.reader, tuple(numbers))
        read()
        row: Row = {name: convert(value) for (name, convert), value in zip(numbers.items(), array.tolist())}
        for v in variables:
            if v.kind not in _CONVERT:
                content = self.content(v)
                row[v.name] = content if v.kind == "Binary" else content.decode("utf-8", "replace")
        return row

    def _transfer_of(
        self, make: Callable[[Sequence[str], Floats], Transfer], names: tuple[str, ...]
    ) -> tuple[Floats, Transfer]:
        """The array of a reader or writer of variables, and its call, which is made once."""
        key = make.__name__, names
        if key not in self._transfers:
            array = np.zeros(len(names))
            self._transfers[key] = array, make(names, array)
        return self._transfers[key]

    # -- state ----------------------------------------------------------------------------------------------

    def state(self) -> Any:
        """A copy of the state, for `restore_state` of this instance."""
        return self._call(self.state_calls[0])

    def restore_state(self, state: Any) -> None:
        """Restore a state, and free it."""
        _, _, free, _, put = self.state_calls
        self._call(put, state)
        self._call(free, state)

    # -- inside ---------------------------------------------------------------------------------------------

    def no_instance(self, why: str) -> SimulatorError:
        """As `NativeInstance`."""
        return SimulatorError(self.reported(instantiates(self.model.version, self.model.interface), why))

    def failure(self, function: str, status: int, otherwise: str | None = None) -> SimulatorError:
        """As `NativeInstance`: an error of whatever kind is a refusal."""
        self.failed = True
        silent = otherwise or self.problem() or f"status {status}"
        return SimulatorError(self.reported(function, failure_text(self._messages, silent)[0]))

    def reported(self, function: str, what: str) -> str:
        """As `NativeInstance`; a finding names its FMU already."""
        return f"{function}: {what}"

    def collect_warnings(self) -> None:
        """Keep all messages."""

    def guarded(self, call: Callable[..., int]) -> Callable[..., int]:
        """As `NativeInstance`."""
        inner = super().guarded(call)

        def called(*arguments: Any) -> int:
            self._expect_alive()
            self._beat()
            try:
                return inner(*arguments)
            finally:
                self._beat()

        return called

    def _call(self, method: str, *args: Any, **kwargs: Any) -> Any:
        self._beat()
        try:
            return super()._call(method, *args, **kwargs)
        finally:
            self._beat()

    def _expect_supported(self) -> None:
        """Any FMU is run, as far as it can be without clocks."""


class CheckedInstance2(CheckedInstance, Fmi2Instance):
    """An instance of FMI 2.0."""


class CheckedInstance3(CheckedInstance, Fmi3Instance):
    """An instance of FMI 3.0, without event mode and early return, which an importer need not support."""

    def step(self, t: float, h: float) -> None:
        """As `Fmi3Instance`; the FMU must not request what was not offered."""
        try:
            super().step(t, h)
        except StoppedStepError:
            raise
        except SimulatorError:
            for flag, request in ((self._event, "eventHandlingNeeded"), (self._early, "earlyReturn")):
                if flag:
                    what = f"{request} = true from {t} to {t + h}: expected false, it was not offered"
                    raise SimulatorError(self.reported("fmi3DoStep", what)) from None
            raise
        if not math.isfinite(self._reached.value):
            what = f"lastSuccessfulTime = {self._reached.value} from {t} to {t + h}: expected a time"
            raise self.failure("fmi3DoStep", 0, what)


class _CheckedModel(CheckedInstance, AdaptedInstance):
    """An instance for model exchange."""

    def state(self) -> Any:
        """As `CheckedInstance`."""
        return self.own_state(), super().state()

    def restore_state(self, state: Any) -> None:
        """As `CheckedInstance`."""
        own, of_fmu = state
        super().restore_state(of_fmu)
        self.restore_own(own)


class CheckedModel2(_CheckedModel, Adapted2):
    """An instance of FMI 2.0 for model exchange."""

    def numbers_of_states(self) -> tuple[int, int]:
        """As `CheckedInstance`: as many as it writes of those that are asked of it, by their numbers as described."""
        states, indicators = self._sizes()
        return self._written("getContinuousStates", states), self._written("getEventIndicators", indicators)

    def _written(self, method: str, asked: int) -> int:
        """How many numbers a function writes, up to the last that is none before."""
        values = np.full(asked + _MORE, math.nan)
        self._call(method, values.ctypes.data_as(ctypes.POINTER(ctypes.c_double)), asked)
        return int(np.flatnonzero(~np.isnan(values)).max(initial=-1)) + 1


class CheckedModel3(_CheckedModel, Adapted3):
    """An instance of FMI 3.0 for model exchange."""

    def numbers_of_states(self) -> tuple[int, int]:
        """As `CheckedInstance`."""
        return self._sizes()


def instance_of(model: Model, folder: Path, name: str, beat: Beat) -> CheckedInstance:
    """A fresh instance of the FMU unpacked in `folder`; raises `SimulatorError`."""
    if model.interface == "model-exchange":
        return (CheckedModel2 if model.version == 2 else CheckedModel3)(model, folder, name, beat)
    return (CheckedInstance2 if model.version == 2 else CheckedInstance3)(model, folder, name, beat)
