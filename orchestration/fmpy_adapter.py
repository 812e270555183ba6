"""An FMU as a `Simulator`, through fmpy, with every array of a step allocated once."""

import ctypes
import difflib
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
import numpy.typing as npt
from fmpy import fmi2
from fmpy.fmi1 import FMICallException
from fmpy.model_description import ModelDescription, ScalarVariable

from fmu_kit import loader
from orchestration import scratch
from orchestration.errors import QuadcosimError, RefusedValueError, SimulatorError, UsageError, shown
from orchestration.fmi.model import read_model
from orchestration.messages import PYTHONFMU_ENTRY, WARNING, Message, collecting_callbacks, words
from orchestration.scratch import Scratch
from orchestration.simulator import Floats, Transfer
from orchestration.timing import is_number

DIVERGENCE_CATEGORY = b"divergence"

_STORED = {"Real": np.float64, "Integer": np.int32, "Boolean": np.int32, "Enumeration": np.int32}
_CALLED = {"Real": "Real", "Integer": "Integer", "Boolean": "Boolean", "Enumeration": "Integer"}


class FmuSimulator:
    """One instance of a co-simulation FMU.

    The FMU's log is on and collected, so that a failed call raises `SimulatorError` with the FMU's own
    words. After a failed call the instance is never called again, not even to free it: FMI leaves what
    would happen undefined.
    """

    def __init__(self, path: Path, instance_name: str) -> None:
        self.path = path
        self.name = instance_name
        self.warnings: list[str] = []
        self.failed = False
        """Whether a call has failed: the instance is then never called again."""
        self._messages: list[Message] = []
        self._given: set[str] = set()  # until initialisation ends, as then the FMU has taken all of it
        self._folder: Scratch | None = None
        self.model = read_model(path)
        self.description: ModelDescription = self.model.description
        if self.model.version != 2:
            raise UsageError(f"{path}: FMI {self.description.fmiVersion}; expected FMI 2.0 for co-simulation")
        if fmpy.platform not in fmpy.supported_platforms(str(path)):
            raise QuadcosimError(
                f"{path}: has no binary for {fmpy.platform}; pythonfmu ships them for 64-bit Linux and Windows only"
            )
        try:
            self._folder = scratch.temporary()
            fmpy.extract(str(path), str(self._folder.path))
            expect_readable_place(self._folder.path)
            self._fmu = fmi2.FMU2Slave(
                guid=self.description.guid,
                unzipDirectory=str(self._folder.path),
                modelIdentifier=self.description.coSimulation.modelIdentifier,
                instanceName=instance_name,
            )
            callbacks = collecting_callbacks(self._messages, instance_name, self._folder.path)
            self._fmu.instantiate(callbacks=callbacks, loggingOn=True)
            release_interpreter_state(self._fmu.dll)
        except Exception as error:
            self.failed = True
            self.close()
            said, _ = words(self._messages, str(error))
            raise QuadcosimError(f"{path}: expected a co-simulation FMU that loads here: {said}") from error
        self.variables: dict[str, ScalarVariable] = {v.name: v for v in self.description.modelVariables}
        self._component = self._fmu.component
        self._do_step = self._fmu.dll.fmi2DoStep

    # -- a run --------------------------------------------------------------------------------------------

    def enter_initialization(self, start: float, stop: float) -> None:
        """Begin initialisation of a run over [start, stop] seconds."""
        self._call("setupExperiment", startTime=start, stopTime=stop)
        self._call("enterInitializationMode")

    def exit_initialization(self) -> None:
        """End initialisation."""
        self._call("exitInitializationMode")
        self._given.clear()
        self._collect_warnings()

    def step(self, t: float, h: float) -> None:
        """Advance from `t` to `t + h` seconds."""
        if self._do_step(self._component, t, h, True) > WARNING:
            raise self._failure("fmi2DoStep")
        if self._messages:
            self._collect_warnings()

    def reset(self) -> None:
        """Back to the state after instantiation, all parameters at their defaults."""
        self._call("reset")
        self._given.clear()
        self.warnings.clear()

    def save(self) -> bytes:
        """The whole state, serialised."""
        state = self._call("getFMUstate")
        content = bytes(self._call("serializeFMUstate", state))
        self._call("freeFMUstate", state)
        return content

    def restore(self, state: bytes) -> None:
        """Put back what `save` gave."""
        handle = self._call("deSerializeFMUstate", state)
        self._call("setFMUstate", handle)
        self._call("freeFMUstate", handle)

    def close(self) -> None:
        """Free the instance and what was unpacked for it."""
        if not self.failed:
            self.failed = True
            self._fmu.freeInstance()
        if self._folder is not None:
            self._folder.remove()
            self._folder = None

    def __enter__(self) -> "FmuSimulator":
        return self

    def __exit__(self, *exception: object) -> None:
        self.close()

    # -- values -------------------------------------------------------------------------------------------

    def names(self, *causalities: str, kind: str = "Real") -> tuple[str, ...]:
        """Variables of a type and of one of the causalities, in the order of the description."""
        return tuple(v.name for v in self.variables.values() if v.type == kind and v.causality in causalities)

    def reader(self, names: Sequence[str], into: Floats) -> Transfer:
        """A call that puts the values of the variables `names` into `into`; a Boolean is 0 or 1."""
        parts = self._by_kind(names)
        if [kind for kind, _ in parts] in ([], ["Real"]):
            return self._transfer("fmi2GetReal", names, into)
        reads = []
        for kind, places in parts:
            values = np.zeros(len(places), dtype=_STORED[kind])
            call = self._transfer(f"fmi2Get{_CALLED[kind]}", [names[i] for i in places], values)
            reads.append((call, values, np.array(places)))

        def read() -> None:
            for call, values, places in reads:
                call()
                into[places] = values

        return read

    def writer(self, names: Sequence[str], source: Floats) -> Transfer:
        """A call that sets the variables `names` from `source`.

        A Boolean is true for what is not 0; an Integer or Enumeration takes the nearest whole number.
        """
        parts = self._by_kind(names)
        if [kind for kind, _ in parts] in ([], ["Real"]):
            return self._transfer("fmi2SetReal", names, source)
        writes = []
        for kind, places in parts:
            values = np.zeros(len(places), dtype=_STORED[kind])
            call = self._transfer(f"fmi2Set{_CALLED[kind]}", [names[i] for i in places], values)
            writes.append((call, values, np.array(places), kind))

        def write() -> None:
            for call, values, places, kind in writes:
                chosen = source[places]
                values[:] = chosen if kind == "Real" else chosen != 0.0 if kind == "Boolean" else np.rint(chosen)
                call()

        return write

    def _by_kind(self, names: Sequence[str]) -> list[tuple[str, list[int]]]:
        """Places in `names` by type."""
        found: dict[str, list[int]] = {}
        for i, name in enumerate(names):
            found.setdefault(self.model.variable(name, self.name).kind, []).append(i)
        return list(found.items())

    def set(self, name: str, value: float | bool | str) -> None:
        """Set one variable, converted to its type; raises `UsageError` for a value it cannot take."""
        variable = self.variable(name)
        reference = [variable.valueReference]
        self._given.add(name)
        if variable.type == "Boolean":
            self._expect(isinstance(value, bool), name, value, "true or false")
            self._call("setBoolean", reference, [value])
        elif variable.type == "Integer":
            whole = isinstance(value, int) and not isinstance(value, bool) and -(2**31) <= value < 2**31
            self._expect(whole, name, value, "a whole number of 32 bits")
            self._call("setInteger", reference, [value])
        else:
            self._expect(is_number(value), name, value, "a number")
            self._call("setReal", reference, [float(value)])

    def get(self, name: str) -> float | bool:
        """The value of one variable."""
        variable = self.variable(name)
        getter = {"Boolean": "getBoolean", "Integer": "getInteger"}.get(variable.type, "getReal")
        value = self._call(getter, [variable.valueReference])[0]
        return bool(value) if variable.type == "Boolean" else float(value)

    def variable(self, name: str) -> ScalarVariable:
        """The declaration of a variable; raises `UsageError` naming the valid parameters."""
        if name in self.variables:
            return self.variables[name]
        parameters = [v.name for v in self.variables.values() if v.causality == "parameter"]
        close = difflib.get_close_matches(name, list(self.variables), n=1)
        hint = f"did you mean {close[0]}? " if close else ""
        raise UsageError(
            f"{self.name}.{name}: {self.description.modelName} has no such variable; {hint}"
            f"its parameters are {', '.join(parameters)}"
        )

    # -- inside -------------------------------------------------------------------------------------------

    def _expect(self, condition: bool, name: str, value: object, expected: str) -> None:
        if not condition:
            raise UsageError(f"{self.name}.{name} = {shown(value)}: expected {expected}")

    def _transfer(self, function: str, names: Sequence[str], array: npt.NDArray[Any]) -> Transfer:
        count = len(names)
        if array.shape != (count,):
            raise ValueError(f"{function}: expected an array of {count} values, got shape {array.shape}")
        references = (ctypes.c_uint32 * count)(*(self.variable(name).valueReference for name in names))
        kind = ctypes.c_double if array.dtype == np.float64 else ctypes.c_int32
        values = (kind * count).from_buffer(array)  # type: ignore[arg-type]
        call, component, failure = getattr(self._fmu.dll, function), self._component, self._failure

        def transfer() -> None:
            if call(component, references, count, values) > WARNING:
                raise failure(function)

        return transfer

    def _call(self, method: str, *args: Any, **kwargs: Any) -> Any:
        if self.failed:
            raise SimulatorError(f"{self.name}: the FMU has failed and is not called again")
        try:
            return getattr(self._fmu, method)(*args, **kwargs)
        except FMICallException as error:
            raise self._failure(error.function) from None

    def _collect_warnings(self) -> None:
        for status, _, message in self._messages:
            if status == WARNING:
                self.warnings.append(f"{self.name}: {message.decode('utf-8', 'replace')}")
        self._messages.clear()

    def _failure(self, function: str) -> SimulatorError:
        """The error for a call that failed, in the words that the FMU logged."""
        self.failed = True
        diverged = [m for m in self._messages if m[0] > WARNING and m[1] == DIVERGENCE_CATEGORY]
        summary, details = words(diverged or self._messages, "no message")
        if not diverged and self._names_what_was_given(summary):
            return RefusedValueError(f"{self.name}.{summary}", details=details)
        return SimulatorError(
            f"{self.name} ({self.description.modelName}): {function}: {summary}",
            divergence=bool(diverged),
            details=details,
        )

    def _names_what_was_given(self, text: str) -> bool:
        """Whether the message `NAME = VALUE: expected …` is about a variable, or a vector of one, that was set."""
        name, equals, _ = text.partition(" = ")
        vector = name.partition(".{")[0]
        return bool(equals) and any(given == name or given.startswith(f"{vector}.") for given in self._given)


def uri_is_read(folder: Path) -> bool:
    """Whether pythonfmu 0.7.0 finds an FMU that is unpacked in `folder`; it crashes where it does not.

    It is given the folder as a URI, of whose escapes it knows that of the space only.
    """
    return "%" not in folder.as_uri().replace("%20", "")


def expect_readable_place(folder: Path) -> None:
    """Raises `QuadcosimError` if pythonfmu would crash on the folder in which its FMU was unpacked.

    Not so behind the loader of this project, which reads the URI before it.
    """
    decoded = fmpy.platform == "linux64" and (folder / loader.BESIDE).is_file()
    if (folder / PYTHONFMU_ENTRY).is_file() and not decoded and not uri_is_read(folder):
        raise QuadcosimError(
            f"unpacked in {folder}; pythonfmu reads no path with other characters than ASCII letters, digits, "
            "spaces and - . _ ~: set TMPDIR (on Windows TEMP) to such a folder"
        )


def release_interpreter_state(library: ctypes.CDLL) -> None:
    """Have pythonfmu let go of what it would otherwise free twice when its library is unloaded.

    In pythonfmu 0.7.0 the unloading releases a static pointer after its destructor has run, which now and then
    corrupts the heap as the process ends. Released before, both do nothing. It holds a thread that initialises
    Python where the host has not, so a host that is Python has no use for it. FMUs of this project do so
    themselves; those that pythonfmu's own builder packed do not.
    """
    release = getattr(library, "finalizePythonInterpreter", None)
    if release is not None:
        release()
