"""An instance of an FMU under validation, by plain FMI calls, for any variable type and any order of calls."""

import math
import struct
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from itertools import accumulate
from pathlib import Path
from typing import Any, ClassVar, TypeAlias

from fmpy import fmi2
from fmpy.fmi1 import FMICallException

from orchestration.components.checks.validation.declared import Variable
from orchestration.components.checks.validation.fmu import Fmu
from orchestration.components.fmi.messages import Message, failure_text
from orchestration.components.fmi.slaves import instantiate, load_slave
from orchestration.foundation.basics.errors import QuadcosimError

Value: TypeAlias = float | int | bool | str | bytes
Values: TypeAlias = Mapping[str, Value]
Row: TypeAlias = dict[str, Value]
"""Values by the names of the variables"""

_CONVERT: dict[str, Callable[[Any], Value]] = {
    "Real": float, "Integer": int, "Enumeration": int, "Boolean": bool, "Binary": lambda content: bytes(content or b""),
    "String": lambda text: (text or b"").decode("utf-8", "replace"),
}  # fmt: skip


class RefusedError(QuadcosimError):
    """The FMU did not carry out a call; the text names the call and has the FMU's message."""


class CheckedInstance:
    """One instance; after a failed call it is never called again, not even to free it."""

    def __init__(self, fmu: Fmu, folder: Path, name: str, beat: Callable[[], None]) -> None:
        self.fmu = fmu
        self.messages: list[Message] = []
        self._arrays: dict[str, list[Any]] = {}  # as last set: a call sets a whole one
        self._failed = True
        self._beat = beat
        beat()
        try:
            self._slave = load_slave(fmu.version, folder, token=fmu.guid, identifier=fmu.model_identifier, name=name)
            instantiate(self._slave, self.messages)
        except Exception as error:
            raise RefusedError(f"{fmu.standard.instantiates}: {failure_text(self.messages, str(error))[0]}") from error
        beat()
        self._failed = False

    def __enter__(self) -> "CheckedInstance":
        return self

    def __exit__(self, *exception: object) -> None:
        if not self._failed:
            self._failed = True
            self._slave.freeInstance()

    # -- a run ----------------------------------------------------------------------------------------------

    def begin(self, values: Values, start: float, stop: float | None = None) -> None:
        """Set parameters, enter initialisation mode, set inputs; `stop` is None if no stop time is defined."""
        inputs = {name: value for name, value in values.items() if self.fmu.elements_by_name[name].causality == "input"}
        self.set({name: value for name, value in values.items() if name not in inputs})
        self._enter(start, stop)
        self.set(inputs)

    def initialise(self, values: Values, start: float, stop: float | None = None) -> None:
        """Initialise the instance."""
        self.begin(values, start, stop)
        self._call("exitInitializationMode")

    def step(self, t: float, h: float) -> bool:
        """Step from `t` to `t + h` seconds; False if the FMU ends the run."""
        raise NotImplementedError

    def terminate(self) -> None:
        """End the run."""
        self._call("terminate")

    def reset(self) -> None:
        """Return to the state after instantiation."""
        self._call("reset")
        self._arrays.clear()

    # -- values ---------------------------------------------------------------------------------------------

    def set(self, values: Values) -> None:
        """Set scalars, and elements of arrays, by name."""
        whole: dict[str, tuple[Variable, list[Any]]] = {}
        for name, value in values.items():
            v = self.fmu.elements_by_name[name]
            _, content = whole.setdefault(v.whole, (v, self._content(v)))
            content[v.element] = value
        for v, content in whole.values():
            self._call(f"set{self.fmu.standard.access[v.type]}", [v.reference], content)

    def get(self, variables: Iterable[Variable]) -> Row:
        """The values of scalars and of elements of arrays, read by type."""
        by_type: dict[str, list[Variable]] = {}
        for v in variables:
            by_type.setdefault(v.type, []).append(v)
        row: Row = {}
        for type, group in by_type.items():
            row.update(self._values_of_type(type, group))
        return row

    def _values_of_type(self, type: str, group: Sequence[Variable]) -> Iterator[tuple[str, Value]]:
        """The values of variables of one type by their names; an array is read once."""
        access, convert = self.fmu.standard.access[type], _CONVERT[self.fmu.standard.types[type]]
        references = {v.whole: v.reference for v in group}
        lengths = [self.fmu.lengths[name] for name in references]
        more = {} if sum(lengths) == len(lengths) else {"nValues": sum(lengths)}
        values = self._call(f"get{access}", list(references.values()), **more)
        first = dict(zip(references, accumulate(lengths, initial=0)))
        for v in group:
            yield v.name, convert(values[first[v.whole] + v.element])

    def _content(self, v: Variable) -> list[Any]:
        """The values last set of the variable that `v` belongs to, or else its starts, to be changed."""
        if self.fmu.lengths[v.whole] == 1:
            return [v.start_value]
        if v.whole not in self._arrays:
            self._arrays[v.whole] = [e.start_value for e in self.fmu.elements if e.whole == v.whole]
        return self._arrays[v.whole]

    # -- state ----------------------------------------------------------------------------------------------

    _states: ClassVar[tuple[str, str, str, str, str]]
    """names in fmpy of the calls that get, serialise, free, deserialise and set a state"""

    def state(self) -> Any:
        """A copy of the state, for `restore` of this instance."""
        return self._call(self._states[0])

    def restore(self, state: Any) -> None:
        """Restore a state, and free it."""
        _, _, free, _, put = self._states
        self._call(put, state)
        self._call(free, state)

    def serialised(self) -> bytes:
        """The state as bytes."""
        get, serialise, free, _, _ = self._states
        state = self._call(get)
        content = bytes(self._call(serialise, state))
        self._call(free, state)
        return content

    def restore_bytes(self, content: bytes) -> None:
        """Restore a state that `serialised` of any instance of the FMU returned."""
        self.restore(self._call(self._states[3], content))

    # -- inside ---------------------------------------------------------------------------------------------

    def _enter(self, start: float, stop: float | None) -> None:
        """Enter initialisation mode."""
        raise NotImplementedError

    def _call(self, method: str, *args: Any, **kwargs: Any) -> Any:
        if self._failed:
            raise RefusedError(f"{method}: the instance has failed and is not called again")
        self._beat()
        try:
            return getattr(self._slave, method)(*args, **kwargs)
        except FMICallException as error:
            raise self._refusal(error.function, f"status {error.status}") from None
        finally:
            self._beat()

    def _refusal(self, function: str, otherwise: str) -> RefusedError:
        self._failed = True
        return RefusedError(f"{function}: {failure_text(self.messages, otherwise)[0]}")


class Instance2(CheckedInstance):
    """An instance of FMI 2.0."""

    _states = ("getFMUstate", "serializeFMUstate", "freeFMUstate", "deSerializeFMUstate", "setFMUstate")

    def _enter(self, start: float, stop: float | None) -> None:
        self._call("setupExperiment", startTime=start, stopTime=stop)
        self._call("enterInitializationMode")

    def step(self, t: float, h: float) -> bool:
        """As `CheckedInstance`."""
        if self._failed:
            raise RefusedError("fmi2DoStep: the instance has failed and is not called again")
        self._beat()
        try:
            self._slave.doStep(currentCommunicationPoint=t, communicationStepSize=h)
        except FMICallException as error:
            if error.status == fmi2.fmi2Discard and self._call("getBooleanStatus", fmi2.fmi2Terminated):
                return False
            raise self._refusal(error.function, f"status {error.status}") from None
        self._beat()
        return True


class Instance3(CheckedInstance):
    """An instance of FMI 3.0, without event mode and early return, which an importer need not support."""

    _states = ("getFMUState", "serializeFMUState", "freeFMUState", "deserializeFMUState", "setFMUState")

    def _enter(self, start: float, stop: float | None) -> None:
        self._call("enterInitializationMode", startTime=start, stopTime=stop)

    def step(self, t: float, h: float) -> bool:
        """As `CheckedInstance`; the FMU must not request what was not offered."""
        event, ends, early, reached = self._call("doStep", t, h)
        if ends:
            return False
        if event or early:
            request = "eventHandlingNeeded" if event else "earlyReturn"
            self._failed = True
            raise RefusedError(f"fmi3DoStep: {request} = true from {t} to {t + h}: expected false, it was not offered")
        if not math.isfinite(reached):
            self._failed = True
            raise RefusedError(f"fmi3DoStep: lastSuccessfulTime = {reached} from {t} to {t + h}: expected a time")
        return True


def instance_of(fmu: Fmu, folder: Path, name: str, beat: Callable[[], None]) -> CheckedInstance:
    """A fresh instance of the FMU unpacked in `folder`; raises `RefusedError`."""
    return (Instance2 if fmu.version == 2 else Instance3)(fmu, folder, name, beat)


def same(a: Value, b: Value) -> bool:
    """Whether two values have the same bits."""
    if isinstance(a, float) and isinstance(b, float):
        return struct.pack("d", a) == struct.pack("d", b)
    return a == b
