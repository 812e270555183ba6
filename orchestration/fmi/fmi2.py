"""An instance of an FMI 2.0 FMU for co-simulation."""

from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from fmpy import fmi2

from orchestration.basics.errors import UsageError
from orchestration.fmi.messages import WARNING, collecting_callbacks
from orchestration.fmi.native import NativeInstance


class Fmi2Instance(NativeInstance):
    """See `NativeInstance`."""

    stored: ClassVar = {"Real": np.float64, "Integer": np.int32, "Boolean": np.int32, "Enumeration": np.int32}
    counts_values = False
    state_calls = ("getFMUstate", "serializeFMUstate", "freeFMUstate", "deSerializeFMUstate", "setFMUstate")

    def _expect_supported(self) -> None:
        if self.model.version != 2:
            raise UsageError(f"{self.path}: FMI {self.description.fmiVersion}; expected FMI 2.0 for co-simulation")

    def _instantiated(self, folder: Path) -> Any:
        fmu = fmi2.FMU2Slave(
            guid=self.description.guid,
            unzipDirectory=str(folder),
            modelIdentifier=self.description.coSimulation.modelIdentifier,
            instanceName=self.name,
        )
        fmu.instantiate(callbacks=collecting_callbacks(self._messages, self.name, folder), loggingOn=True)
        self._do_step = self.watched(fmu.dll.fmi2DoStep)
        return fmu

    def _enter(self, start: float, stop: float) -> None:
        self._call("setupExperiment", startTime=start, stopTime=stop)
        self._call("enterInitializationMode")

    def step(self, t: float, h: float) -> None:
        """Advance from `t` to `t + h` seconds."""
        if self._do_step(self._component, t, h, True) > WARNING:
            raise self.failure("fmi2DoStep")
        if self._messages:
            self.collect_warnings()

    def _access(self, action: str, type: str) -> str:
        return f"fmi2{action}{'Integer' if type == 'Enumeration' else type}"
