"""A slave in Python and the same one compiled, called alike: what they answer, to the last bit."""

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from fmpy import fmi2
from fmpy.fmi1 import FMICallException

from fmu_kit.bundle import Target
from fmu_kit.compiler.emit.standards import STANDARDS
from fmu_kit.compiler.pack import building
from fmu_kit.compiler.pack.building import c_sources, modules_of
from fmu_kit.compiler.pack.c_compiler import Mathematics
from fmu_kit.compiler.passes.precomputing import precompute
from fmu_kit.compiler.trace.tracing import Program, trace
from fmu_kit.packaging import slave_class
from fmu_kit.slave import Slave
from fmu_kit.variables import Variable

GUID = "{00000000-0000-0000-0000-000000000000}"
Values = Mapping[str, float | int | bool]
Answer = tuple[str, ...]


def library(target: Target, folder: Path) -> Path:
    """The library of a slave that is written out as C, on the libm that CPython takes."""
    return compiled(precompute(trace(slave_class(target), modules_of(target))), folder / f"{target.model}.so", "libm")


def compiled(program: Program, path: Path, mathematics: Mathematics) -> Path:
    """The library of a traced slave, as FMI 2.0; one of the same sources is not compiled again."""
    path.write_bytes(building.library(c_sources(program, GUID, STANDARDS[2]), STANDARDS[2].main, mathematics))
    return path


def access(variable: Variable) -> str:
    """The type whose functions of FMI 2.0 get and set a variable."""
    return "Integer" if variable.type == "Enumeration" else variable.type


def exact(value: float | int | bool) -> str:
    """A value to the last bit; what is not a number has no bits that count."""
    return "nan" if value != value else float(value).hex()


PLACE = re.compile(r" \(in [^()]+, line \d+\)$")
"""Where in Python something diverged, which C does not say"""


@dataclass
class InPython:
    """The slave as it is."""

    slave: Slave

    def begin(self, values: Values, start: float) -> Answer:
        """Through initialisation."""
        return self._answer(lambda: self._begin(values, start))

    def step(self, values: Values, t: float, h: float) -> Answer:
        """A step with these values."""
        return self._answer(lambda: self._step(values, t, h))

    def _step(self, values: Values, t: float, h: float) -> None:
        self._set(values)
        self.slave.do_step(t, h)

    def _begin(self, values: Values, start: float) -> None:
        self._set(values)
        self.slave.setup_experiment(start)
        self.slave.enter_initialization_mode()
        self.slave.exit_initialization_mode()

    def _set(self, values: Values) -> None:
        for name, value in values.items():
            vr = type(self.slave)._index[name]
            getattr(self.slave, f"set_{access(self.slave.variables[vr]).lower()}")([vr], [value])

    def _answer(self, call: Callable[[], object]) -> Answer:
        try:
            call()
        except Exception as error:
            diverged = any(getattr(message, "category", "") == "divergence" for message in self.slave.log_queue)
            line = str(error).splitlines()[0].replace("%%", "%")
            return ("diverged", PLACE.sub("", line)) if diverged else ("failed", line)
        words = [message.msg.replace("%%", "%") for message in self.slave.log_queue]
        self.slave.log_queue.clear()
        found = [*self.slave._reals, *self.slave._others.values()]
        return (*words, *map(exact, found))


@dataclass
class InC:
    """The same in C."""

    slave: type[Slave]
    fmu: Any
    messages: list[tuple[str, str]] = field(default_factory=list)

    @classmethod
    def made(cls, slave: type[Slave], path: Path) -> "InC":
        """An instance of a library."""
        messages: list[tuple[str, str]] = []

        def log(_: Any, __: bytes, status: int, category: bytes | None, message: bytes) -> None:
            messages.append(((category or b"").decode(), message.decode().replace("%%", "%")))

        callbacks = fmi2.fmi2CallbackFunctions()
        callbacks.logger = fmi2.fmi2CallbackLoggerTYPE(log)
        fmu = fmi2.FMU2Slave(
            guid=GUID, unzipDirectory=str(path.parent), modelIdentifier=path.stem, libraryPath=str(path)
        )
        fmu.instantiate(callbacks=callbacks, loggingOn=True)
        return cls(slave, fmu, messages)

    def begin(self, values: Values, start: float) -> Answer:
        """Through initialisation."""
        return self._answer(lambda: self._begin(values, start))

    def step(self, values: Values, t: float, h: float) -> Answer:
        """A step with these values."""
        return self._answer(lambda: self._step(values, t, h))

    def _step(self, values: Values, t: float, h: float) -> None:
        self._set(values)
        self.fmu.doStep(t, h)

    def _begin(self, values: Values, start: float) -> None:
        self._set(values)
        self.fmu.setupExperiment(startTime=start)
        self.fmu.enterInitializationMode()
        self.fmu.exitInitializationMode()

    def _set(self, values: Values) -> None:
        for name, value in values.items():
            vr = self.slave._index[name]
            getattr(self.fmu, f"set{access(self.slave.variables[vr])}")([vr], [value])

    def _answer(self, call: Callable[[], object]) -> Answer:
        self.messages.clear()
        try:
            call()
        except FMICallException:
            category, words = self.messages[-1]
            return "diverged" if category == "divergence" else "failed", words
        found = []
        for vr, variable in enumerate(self.slave.variables):
            found += getattr(self.fmu, f"get{access(variable)}")([vr])
        return (*(text for _, text in self.messages), *map(exact, found))


def answers(twin: InPython | InC, start: Values, steps: Sequence[Values]) -> list[Answer]:
    """What comes of initialisation and steps, up to the first failure."""
    found = [twin.begin(start, 0.5)]
    for k, values in enumerate(steps):
        if found[-1][0] in ("failed", "diverged"):
            break
        found.append(twin.step(values, 0.5 + 0.25 * k, 0.25))
    return found
