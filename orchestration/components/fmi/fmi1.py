"""An instance of an FMI 1.0 FMU for co-simulation, which has one call for the whole of its initialisation."""

import ctypes
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from fmpy import fmi1

from orchestration.components.fmi import slaves
from orchestration.components.fmi.fmi2 import Fmi2Instance
from orchestration.components.fmi.instance import Value
from orchestration.components.fmi.transfers import Numbers
from orchestration.foundation.basics.errors import QuadcosimError, SimulatorError, UsageError
from orchestration.foundation.basics.simulator import Transfer


class FMU1Slave(fmi1.FMU1Slave):  # type: ignore[misc]  # fmpy is untyped, and derives the version from this name
    """Of FMI 1.0; fmpy takes the status that some of its functions return for the address of a text."""

    def _loadFunctions(self) -> None:  # noqa: N802
        super()._loadFunctions()
        for name, function in self._functions.items():
            if name not in ("fmi1GetVersion", "fmi1GetTypesPlatform") and function.restype is ctypes.c_char_p:
                function.restype = ctypes.c_int


class Fmi1Instance(Fmi2Instance):
    """See `NativeInstance`; its calls of values and steps are those of FMI 2.0, by other names.

    Its initialisation waits until a value is read, or for its end: inputs that are set before have an effect on it.
    """

    version: ClassVar = 1
    stored: ClassVar = {"Real": np.float64, "Integer": np.int32, "Boolean": np.int8, "Enumeration": np.int32}
    _span: tuple[float, float | None] | None = None
    """Times of the initialisation that waits [s]; None: there is none"""

    def _instantiate(self, folder: Path) -> Any:
        with slaves.in_terms_of_the_archive(folder):
            fmu = FMU1Slave(
                guid=self.description.guid, modelIdentifier=self.model.capabilities.modelIdentifier,
                unzipDirectory=str(folder), instanceName=self.name,
            )  # fmt: skip
        callbacks = slaves.collecting_callbacks(self._messages, self.name, folder)  # those of FMI 1.0 are its first
        fmu.instantiate(functions=fmi1.fmi1CallbackFunctions.from_buffer(callbacks), loggingOn=True)
        if fmu.component is None:
            raise QuadcosimError("fmiInstantiateSlave returned no instance")
        return fmu

    def _load_step(self, library: Any) -> None:
        self._do_step = self.guarded(self._fmu._functions["fmi1DoStep"])

    def _access(self, action: str, type: str) -> str:
        return super()._access(action, type).replace("fmi1", f"{self._fmu.modelIdentifier}_fmi")

    def _enter(self, start: float, stop: float | None) -> None:
        self._span = start, stop

    def _begin(self) -> None:
        """Make the call of initialisation, if it waits."""
        if self._span is not None:
            span, self._span = self._span, None
            self._call("initialize", *span)

    def _lost_values(self) -> list[tuple[str, Value]]:
        """Parameters alone, and only afterwards: initialisation may change other start values."""
        if self._span is not None:
            return []
        return [(name, value) for name, value in super()._lost_values() if self.variable(name).causality == "parameter"]

    def exit_initialization(self) -> None:
        """As `NativeInstance`."""
        self._begin()
        self._warn_of_lost_values()
        self._initial_values.clear()
        self.collect_warnings()

    def reset(self) -> None:
        """As `NativeInstance`."""
        super().reset()
        self._span = None

    def set_tolerance(self, tolerance: float) -> None:
        """Raise `UsageError`: an FMU of FMI 1.0 is not told any."""
        raise UsageError(f"{self.name}: tolerance = {tolerance:g}: expected none, as FMI 1.0 has none in co-simulation")

    def _transfer(self, function: str, references: Sequence[int], values: Numbers) -> Transfer:
        call = super()._transfer(function, references, values)
        if function.startswith(self._access("Set", "")):
            return call

        def read() -> None:
            self._begin()
            call()

        return read

    def step_error(self, status: int, end: float) -> SimulatorError:
        """As `NativeInstance`."""
        if status != fmi1.fmi1Discard:
            return self.failure("fmiDoStep", status)
        reached = fmi1.fmi1Real(math.nan)
        ask = self._fmu._functions["fmi1GetRealStatus"]
        ask(self._component, fmi1.fmi1LastSuccessfulTime, ctypes.byref(reached))
        return self._stopped_step("fmiDoStep", end, reached=reached.value, ends=False)

    def reported(self, function: str, what: str) -> str:
        """As `NativeInstance`, with the name of the function in FMI 1.0."""
        return super().reported(function.replace("fmi1", "fmi"), what)
