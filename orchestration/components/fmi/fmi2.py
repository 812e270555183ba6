"""An instance of an FMI 2.0 FMU for co-simulation."""

import ctypes
import math
from typing import Any, ClassVar

import numpy as np
from fmpy import fmi2

from orchestration.components.fmi.native_instance import NativeInstance
from orchestration.components.fmi.slaves import WARNING
from orchestration.foundation.basics.errors import SimulatorError


class Fmi2Instance(NativeInstance):
    """See `NativeInstance`."""

    only_calls = True
    version, enumerations = 2, "Integer"
    stored: ClassVar = {"Real": np.float64, "Integer": np.int32, "Boolean": np.int32, "Enumeration": np.int32}
    counts_values, step_name = False, "fmi2DoStep"
    state_calls = ("getFMUstate", "serializeFMUstate", "freeFMUstate", "deSerializeFMUstate", "setFMUstate")

    def _load_step(self, library: Any) -> None:
        self._do_step = self.guarded(library.fmi2DoStep)

    def _enter(self, start: float, stop: float | None) -> None:
        self._call("setupExperiment", tolerance=self._tolerance, startTime=start, stopTime=stop)
        self._call("enterInitializationMode")

    def step(self, t: float, h: float) -> None:
        """Advance from `t` to `t + h` seconds."""
        t += self.start_time
        status = self._do_step(self._component, t, h, True)
        if status > WARNING:
            raise self.step_error(status, t + h)
        if self._messages:
            self.collect_warnings()

    def step_error(self, status: int, end: float) -> SimulatorError:
        """As `NativeInstance`; after a discarded step the status of the FMU tells whether that ends the run."""
        if status != fmi2.fmi2Discard:
            return self.failure("fmi2DoStep", status)
        ends, reached = fmi2.fmi2Boolean(), fmi2.fmi2Real(math.nan)
        dll, known = self._fmu.dll, (fmi2.fmi2Terminated, fmi2.fmi2LastSuccessfulTime)
        dll.fmi2GetBooleanStatus(self._component, known[0], ctypes.byref(ends))
        dll.fmi2GetRealStatus(self._component, known[1], ctypes.byref(reached))
        return self._stopped_step("fmi2DoStep", end, reached=reached.value, ends=bool(ends))
