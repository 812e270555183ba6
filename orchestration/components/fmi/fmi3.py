"""An instance of an FMI 3.0 FMU for co-simulation: scalars and arrays of numbers."""

import ctypes
from typing import Any, ClassVar

import numpy as np
from fmpy import fmi3

from orchestration.components.fmi.instance import INTEGERS
from orchestration.components.fmi.native_instance import NativeInstance
from orchestration.components.fmi.slaves import WARNING
from orchestration.foundation.basics.errors import SimulatorError


class StepsWithEnd(NativeInstance):
    """An instance whose step says how it has ended, as in FMI 3.0."""

    def _load_step(self, library: Any) -> None:
        self._do_step = self.guarded(getattr(library, self.step_name))
        self._event, self._ends, self._early = ctypes.c_bool(), ctypes.c_bool(), ctypes.c_bool()
        self._reached = ctypes.c_double()
        self.step_outputs = (self._event, self._ends, self._early, self._reached)
        self._step_arguments = [ctypes.byref(x) for x in self.step_outputs]

    def step(self, t: float, h: float) -> None:
        """Advance from `t` to `t + h` seconds."""
        t += self.start_time
        status = self._do_step(self._component, t, h, True, *self._step_arguments)
        if status > WARNING or self._event or self._ends or self._early:
            raise self.step_error(status, t + h)
        if self._messages:
            self.collect_warnings()

    def step_error(self, status: int, end: float) -> SimulatorError:
        """As `NativeInstance`."""
        if status > fmi3.fmi3Discard:
            return self.failure(self.step_name, status)
        reached = self._reached.value
        if self._ends or status == fmi3.fmi3Discard:
            return self._stopped_step(self.step_name, end, reached=reached, ends=self._ends.value)
        what = "asks for event mode" if self._event else "returns early"
        return self.failure(self.step_name, status, f"the FMU {what} at {reached:g} s, before {end:g} s")


class Fmi3Instance(StepsWithEnd):
    """See `NativeInstance`."""

    only_calls = True
    version, enumerations = 3, "Int64"
    stored: ClassVar = {
        **INTEGERS,
        "Float64": np.float64,
        "Float32": np.float32,
        "Boolean": np.bool_,
        "Enumeration": np.int64,
    }
    counts_values, step_name = True, "fmi3DoStep"
    state_calls = ("getFMUState", "serializeFMUState", "freeFMUState", "deserializeFMUState", "setFMUState")

    def _expect_supported(self) -> None:
        super()._expect_supported()
        self.model.expect_clocks_that_tick()

    def _enter(self, start: float, stop: float | None) -> None:
        self._call("enterInitializationMode", tolerance=self._tolerance, startTime=start, stopTime=stop)
