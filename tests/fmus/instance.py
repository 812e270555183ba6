"""An FMU driven by plain FMI calls through fmpy, without the project's own adapter in between."""

import atexit
import functools
import gc
import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import fmpy
from fmpy import fmi2
from fmpy.model_description import ModelDescription, ModelVariable

gc.freeze()  # scripts that collect garbage after each call do not look through what was imported


@functools.cache
def _unpacked(path: Path, changed: int) -> Path:
    """Once in a process for each content of a file."""
    folder = Path(fmpy.extract(str(path)))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    return folder


@functools.cache
def _described(path: Path, changed: int) -> ModelDescription:
    """Read once in a process for each content of a file."""
    return fmpy.read_model_description(str(path), validate=False)


class Message(NamedTuple):
    """What an FMU logged."""

    instance: str
    status: int
    category: bytes | None
    text: str


class Instance:
    """One instance, its log collected in `messages` unless fmpy's own logger is asked for."""

    def __init__(
        self,
        path: Path,
        *,
        unpacked: Path | None = None,
        anew: bool = False,
        default_logger: bool = False,
        name: str = "instance",
        logging: bool = True,
    ) -> None:
        """From the folder where it is `unpacked`; else from one that is this process's, or, `anew`, this instance's."""
        changed = path.stat().st_mtime_ns
        self.description = _described(path, changed)
        self.variables = {v.name: v for v in self.description.modelVariables}
        self._by_getter: dict[str, list[ModelVariable]] = {}
        for variable in self.description.modelVariables:
            self._by_getter.setdefault(_getter(variable), []).append(variable)
        self.messages: list[Message] = []
        self._own_folder = Path(fmpy.extract(str(path))) if anew else None
        self.fmu = fmi2.FMU2Slave(
            guid=self.description.guid,
            unzipDirectory=str(unpacked or self._own_folder or _unpacked(path, changed)),
            modelIdentifier=self.description.coSimulation.modelIdentifier,
            instanceName=name,
        )
        self.fmu.instantiate(callbacks=None if default_logger else self._collecting(), loggingOn=logging)

    def __enter__(self) -> "Instance":
        return self

    def __exit__(self, *exception: object) -> None:
        self.free()

    def free(self) -> None:
        """fmi2FreeInstance, and what was unpacked for this instance."""
        self.fmu.freeInstance()
        if self._own_folder is not None:
            shutil.rmtree(self._own_folder)

    def initialise(self, values: Mapping[str, float | bool], *, start: float = 0.0) -> None:
        """Set the values and go through initialisation."""
        self.set(values)
        self.fmu.setupExperiment(startTime=start)
        self.fmu.enterInitializationMode()
        self.fmu.exitInitializationMode()

    def step(self, t: float, h: float) -> None:
        """fmi2DoStep."""
        self.fmu.doStep(currentCommunicationPoint=t, communicationStepSize=h)

    def set(self, values: Mapping[str, float | bool]) -> None:
        """Set variables by name."""
        for name, value in values.items():
            variable = self.variables[name]
            setter = {"Real": self.fmu.setReal, "Boolean": self.fmu.setBoolean}
            setter.get(variable.type, self.fmu.setInteger)([variable.valueReference], [value])

    def get(self, *names: str) -> list[float]:
        """The values of Real variables."""
        return [float(v) for v in self.fmu.getReal([self.variables[name].valueReference for name in names])]

    def value(self, name: str) -> Any:
        """The value of a variable of any type."""
        variable = self.variables[name]
        return getattr(self.fmu, _getter(variable))([variable.valueReference])[0]

    def names(self, *causalities: str) -> list[str]:
        """Real variables of these causalities."""
        return [v.name for v in self.variables.values() if v.type == "Real" and v.causality in causalities]

    def values(self) -> dict[str, float | int | bool]:
        """Every variable, read in one call for each type."""
        values: dict[str, float | int | bool] = {}
        for getter, variables in self._by_getter.items():
            references = [variable.valueReference for variable in variables]
            values |= zip((variable.name for variable in variables), getattr(self.fmu, getter)(references))
        return {name: values[name] for name in self.variables}

    def everything(self) -> list[str]:
        """Every variable as `name=value`, the value to the last bit."""
        return [f"{name}={_exact(value)}" for name, value in self.values().items()]

    def save(self) -> bytes:
        """The serialised state."""
        state = self.fmu.getFMUstate()
        content = bytes(self.fmu.serializeFMUstate(state))
        self.fmu.freeFMUstate(state)
        return content

    def restore(self, content: bytes) -> None:
        """Put back what `save` of any instance gave."""
        state = self.fmu.deSerializeFMUstate(content)
        self.fmu.setFMUstate(state)
        self.fmu.freeFMUstate(state)

    def _collecting(self) -> fmi2.fmi2CallbackFunctions:
        # Not through fmpy's proxy, which would hand the messages of all instances to the last logger made.
        def log(environment: Any, instance: bytes, status: int, category: bytes | None, message: bytes) -> None:
            self.messages.append(Message(instance.decode(), status, category, message.decode().replace("%%", "%")))

        callbacks = fmi2.fmi2CallbackFunctions()
        callbacks.logger = fmi2.fmi2CallbackLoggerTYPE(log)
        callbacks.allocateMemory = fmi2.fmi2CallbackAllocateMemoryTYPE(fmpy.calloc)
        callbacks.freeMemory = fmi2.fmi2CallbackFreeMemoryTYPE(fmpy.free)
        return callbacks


def _getter(variable: ModelVariable) -> str:
    return {"Real": "getReal", "Boolean": "getBoolean"}.get(variable.type, "getInteger")


def _exact(value: float | int | bool) -> str:
    return value.hex() if isinstance(value, float) else str(value)
