"""Instances of FMUs in this process, through fmpy: the common part of all versions of FMI.

The arrays of a step are allocated once, and the arguments of a transfer are converted to C once.
"""

import ctypes
import math
import tempfile
import zipfile
from abc import abstractmethod
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, ClassVar
from weakref import WeakKeyDictionary

import fmpy
import numpy as np
from fmpy.fmi1 import FMICallException

from fmu_kit import scratch
from fmu_kit.scratch import Scratch
from orchestration.components.fmi import slaves
from orchestration.components.fmi.access import USUAL, Access
from orchestration.components.fmi.instance import NO_STATE, Instance, Value, convert_value, same
from orchestration.components.fmi.read_description import Variable, read_model
from orchestration.components.fmi.surroundings import FOLDER, LIMITS, ROUNDING, Surroundings, sentence
from orchestration.components.fmi.transfers import Numbers, TransferCall, TransferLayout, TransferPart
from orchestration.foundation.basics.errors import (
    QuadcosimError,
    RefusedValueError,
    SimulatorError,
    StoppedStepError,
    UsageError,
    listed,
)
from orchestration.foundation.basics.simulator import Floats, Transfer

DIVERGENCE_CATEGORY = b"divergence"
_AT_END = 1e-9
"""Relative and in [s]: the rounding error at the end of a step of an FMU that sums its steps"""

_MAX_WARNINGS = 100
"""Largest number of warnings kept of an instance; some FMUs log one in every step"""

_NOT_USED = ("documentation/", "sources/")
"""Folders that an FMU of this project's kit never reads"""


class NativeInstance(Instance):
    """One instance of an FMU in this process, of one for co-simulation unless a subclass says otherwise.

    The FMU's log is on and collected, so that a failed call raises `SimulatorError` with the FMU's own
    message. After a failed call the instance is never called again, not even to free it: FMI leaves the
    behaviour undefined.
    """

    def __init__(self, path: Path, instance_name: str, access: Access = USUAL, *, unpacked: Path | None = None) -> None:
        """`unpacked`: the folder in which the FMU is unpacked already; None: it is unpacked for this instance."""
        self.path = path
        self.name = instance_name
        self.warnings: list[str] = []
        self.failed = self.stopped = False
        self._messages = slaves.Messages()
        self._initial_values: dict[str, Value] = {}  # until the end of initialisation
        self._arrays: dict[int, Numbers] = {}  # last values of arrays, by reference: a call sets a whole array
        self._calls: WeakKeyDictionary[Transfer, tuple[TransferCall, ...]] = WeakKeyDictionary()
        self._folder: Scratch | None = None
        self.model = read_model(path, access)
        self._layout = TransferLayout(instance_name, self.model, self.stored)
        self._tolerance = self.model.tolerance
        self.start_time = access.start_time
        """Its own time [s] at 0 of a run: what its functions receive is later by that"""
        self._expect_supported()
        self.guard = None if self.model.is_own else Surroundings()
        try:
            with zipfile.ZipFile(path) as archive:
                slaves.folder_here(self.model.version, slaves.binary_folders(archive.namelist()))
        except QuadcosimError as error:
            raise QuadcosimError(f"{path}: {error}") from None
        try:
            self._fmu = self._instantiate(unpacked or self._unpacked())
            self._library, self._component = self._called()
            self.restore_globals()
        except Exception as error:
            self.failed = True
            self.close()
            if isinstance(error, OSError) and error.errno is not None:  # of the disk: of a library it has no number
                what = f"cannot be unpacked in {tempfile.gettempdir()}, which TMPDIR names: {error.strerror}"
                raise QuadcosimError(f"{path}: {what}") from error
            raise self.no_instance(slaves.failure_text(self._messages, str(error))[0]) from error

    only_calls: ClassVar[bool]
    """Stated by each class that does no more than call functions by their addresses, so that C can do so"""

    reads_exactly = True
    """Whether no number that it reads is rounded; else the nearest float is enough, to compare runs"""

    # -- what differs between versions ---------------------------------------------------------------------------

    version: ClassVar[int]
    """Version of FMI"""
    enumerations: ClassVar[str]
    """the type by whose functions values of an Enumeration are transferred"""
    stored: ClassVar[Mapping[str, type[np.generic]]]
    """the type of the values in memory, by type of the variable"""
    counts_values: ClassVar[bool]
    """whether a call has the number of values beside the number of references: arrays have more"""
    step_outputs: tuple[Any, ...] = ()
    """Arguments into which an FMU of FMI 3.0 writes how a step has ended"""
    state_calls: tuple[str, str, str, str, str]
    """fmpy's names of the calls that get, serialise, free, deserialise and set a state"""

    step_name: ClassVar[str]
    """the name of the function of a step"""

    @abstractmethod
    def _load_step(self, library: Any) -> None:
        """Keep what every step needs of a library."""

    @abstractmethod
    def _enter(self, start: float, stop: float | None) -> None:
        """Enter initialisation mode, with the tolerance if there is one; `stop` is None if no end is defined."""

    @abstractmethod
    def step_error(self, status: int, end: float) -> SimulatorError:
        """The error for the last step, to `end` [s], which did not succeed as a whole; `status` is that of the call."""

    # -- a run ---------------------------------------------------------------------------------------------------

    def enter_initialization(self, start: float, stop: float) -> None:
        """As `Simulator`; values that the FMU has lost are set once more."""
        self._expect_alive()
        begin = self.start_time
        self._enter(begin + start, None if math.isinf(stop) else begin + stop)
        for name, value in self._lost_values():
            self._put(self.variable(name), value)
        self._warn_of_lost_values()

    def _warn_of_lost_values(self) -> None:
        for name, value in self._lost_values():
            self.warnings.append(f"{self.name}.{name}: was set to {value}, the FMU has {self.get(name)}")

    def _lost_values(self) -> list[tuple[str, Value]]:
        """Values that were set and that the FMU no longer has."""
        numbers = [name for name, value in self._initial_values.items() if not isinstance(value, str)]
        values = np.zeros(len(numbers))
        self.reader(numbers, values)()
        kept: dict[str, Value] = dict(zip(numbers, values.tolist()))
        return [
            (name, value)
            for name, value in self._initial_values.items()
            if not same(self.variable(name), value, kept[name] if name in kept else self.get(name))
        ]

    def exit_initialization(self) -> None:
        """End initialisation."""
        self._call("exitInitializationMode")
        self._initial_values.clear()
        self.collect_warnings()

    def reset(self) -> None:
        """Back to the state after instantiation, all parameters at their defaults."""
        self._call("reset")
        self._initial_values.clear()
        self._arrays.clear()
        self.warnings.clear()
        self._tolerance = self.model.tolerance

    def save(self) -> bytes:
        """The whole state, serialised; raises `UsageError` for an FMU that cannot."""
        self._expect_state()
        get, serialise, free, _, _ = self.state_calls
        state = self._call(get)
        content = bytes(self._call(serialise, state))
        self._call(free, state)
        return content

    def restore(self, state: bytes) -> None:
        """Restore a state that `save` returned."""
        self._expect_state()
        _, _, free, deserialise, put = self.state_calls
        handle = self._call(deserialise, state)
        self._call(put, handle)
        self._call(free, handle)
        for reference, values in self._arrays.items():
            kind = next(v.type for v in self.variables.values() if v.length and v.reference == reference)
            self._transfer(self._access("Get", kind), (reference,), values)()

    def close(self) -> None:
        """Free the instance and what was unpacked for it."""
        if not self.failed:
            self.failed = True
            self._fmu.freeInstance()
        if self._folder is not None:
            self._folder.remove()
            self._folder = None

    # -- values --------------------------------------------------------------------------------------------------

    def reader(self, names: Sequence[str], into: Floats) -> Transfer:
        """A call that writes the values of the variables `names` to `into`; a Boolean is 0 or 1.

        With `reads_exactly` it raises `SimulatorError` for a whole number that no float is.
        """
        parts = self._layout.parts(names, into)
        calls = [
            (self._transfer(self._access("Get", x.type), x.references, x.buffer), x, [names[i] for i in x.array_places])
            for x in parts
        ]
        if len(parts) == 1 and parts[0].buffer is into:
            return self._registered(calls[0][0], "Get", parts, into)

        def read() -> None:
            for call, part, of in calls:
                call()
                values = part.buffer[part.places]
                into[part.array_places] = values != 0 if part.type == "Boolean" else values
                if self.reads_exactly:
                    self._layout.expect_floats(of, values)

        return self._registered(read, "Get", parts, into)

    def writer(self, names: Sequence[str], source: Floats) -> Transfer:
        """A call that sets the variables `names` from `source`.

        A Boolean is true for any value but 0; an Integer or Enumeration has the nearest integer. Raises
        `SimulatorError` for one that its type does not hold.
        """
        parts = self._layout.parts(names, source, shared=self._arrays)
        calls = [(self._transfer(self._access("Set", x.type), x.references, x.buffer), x) for x in parts]
        if len(parts) == 1 and parts[0].buffer is source:
            return self._registered(calls[0][0], "Set", parts, source)
        converters = [
            self._layout.converter([names[i] for i in part.array_places], part.buffer.dtype) for part in parts
        ]

        def write() -> None:
            for (call, part), converted in zip(calls, converters):
                part.buffer[part.places] = converted(source[part.array_places])
                call()

        return self._registered(write, "Set", parts, source)

    def slopes(self, outputs: Sequence[str], inputs: Sequence[str]) -> Floats | None:
        """As `Differentiable`: directional derivatives, of scalars."""
        of, by = ([self.variable(name) for name in names] for names in (outputs, inputs))
        if not self.model.has_slopes or any(v.length or v.type not in ("Real", "Float64") for v in (*of, *by)):
            return None
        unknowns, counts = [v.reference for v in of], {"nSensitivity": len(of)} if self.counts_values else {}
        columns = [self._call("getDirectionalDerivative", unknowns, [v.reference], [1.0], **counts) for v in by]
        found: Floats = np.array(columns, dtype=np.float64).T
        return found

    def set(self, name: str, value: Value) -> None:
        """Set one variable, converted to its type; raises `UsageError` for an invalid value."""
        self._expect_alive()
        variable = self.variable(name)
        if variable.causality == "structuralParameter":
            raise UsageError(
                f"{self.name}.{name}: is a structural parameter; expected none, as arrays keep the sizes by its start "
                f"value, {variable.start}: another size takes another FMU"
            )
        converted = convert_value(variable, value, f"{self.name}.{name}")
        self._initial_values[name] = converted
        self._put(variable, converted)

    def set_tolerance(self, tolerance: float) -> None:
        """Set the relative tolerance of its solver, before initialisation; default: that of its declared experiment."""
        self._tolerance = tolerance

    def get(self, name: str) -> Value:
        """The value of one variable."""
        self._expect_alive()
        variable = self.variable(name)
        if variable.kind == "String":
            return self.content(variable).decode("utf-8", "replace")
        value = np.zeros(1)
        self.reader((name,), value)()
        return bool(value[0]) if variable.kind == "Boolean" else float(value[0])

    def content(self, variable: Variable) -> bytes:
        """The bytes of a String or Binary variable, or of an element of an array of them."""
        counts = {"nValues": variable.length} if variable.length else {}
        return bytes(self._call(f"get{variable.kind}", [variable.reference], **counts)[variable.element] or b"")

    # -- global state of this process ------------------------------------------------------------------------------

    guard: Surroundings | None
    """restores global state after its calls; None for an FMU of this project, which does not change any"""

    def restore_globals(self) -> None:
        """Restore what the FMU has changed of the whole process, with a warning."""
        if self.guard is not None:
            self._restore_rounding(self.guard)
            if self.guard.restore_folder():
                self.warn_of_change(FOLDER)
            if self.guard.restore_limits():
                self.warn_of_change(LIMITS)

    def _restore_rounding(self, guard: Surroundings) -> None:
        if guard.restore_rounding():
            self.warn_of_change(ROUNDING)

    def warn_of_change(self, what: str) -> None:
        """Warn, once, that it has changed `what` of the whole process."""
        warning = sentence([f"{self.name} ({self.model.name})"], what)
        if warning not in self.warnings:
            self.warnings.append(warning)

    # -- for the compiled loop, which makes the calls without Python -----------------------------------------------

    def calls_of(self, transfer: Transfer) -> Sequence[TransferCall]:
        """The calls of a transfer of `reader` or `writer`."""
        return self._calls[transfer]

    def address(self, function: str) -> int:
        """The address of a function that transfers values, or steps."""
        return ctypes.cast(self._library[function], ctypes.c_void_p).value or 0

    @property
    def handle(self) -> int:
        """The address of what these functions receive."""
        return self._component.value or 0

    @property
    def messages_waiting(self) -> ctypes.c_int64:
        """The number of messages that have not been processed."""
        return self._messages.waiting

    def _registered(self, transfer: Transfer, action: str, parts: Sequence[TransferPart], array: Floats) -> Transfer:
        self._calls[transfer] = tuple(
            TransferCall(function=self._access(action, part.type), part=part, in_place=part.buffer is array)
            for part in parts
        )
        return transfer

    # -- inside --------------------------------------------------------------------------------------------------

    def _unpacked(self) -> Path:
        """A folder with what the FMU needs to run, until it is closed."""
        self._folder = scratch.temporary()
        fmpy.extract(str(self.path), str(self._folder.path), include=_is_used if self.model.follows_kit else None)
        slaves.expect_readable_place(self._folder.path)
        return self._folder.path

    def no_instance(self, why: str) -> QuadcosimError:
        """The error for an FMU that cannot be loaded or instantiated."""
        return QuadcosimError(f"{self.path}: expected an FMU for {self.model.interface} that loads here: {why}")

    def _instantiate(self, folder: Path) -> Any:
        """fmpy's instance of the FMU unpacked in `folder`, which logs to `_messages`."""
        fmu = slaves.load_slave(
            self.model.version, folder, token=self.description.guid, name=self.name, interface=self.model.interface,
            identifier=self.model.capabilities.modelIdentifier,
        )  # fmt: skip
        slaves.instantiate(fmu, self._messages, self.model.interface)
        return fmu

    def _called(self) -> tuple[Any, ctypes.c_void_p]:
        """The library of the functions that transfer values and step, and what they receive."""
        self._load_step(self._fmu.dll)
        return self._fmu.dll, ctypes.c_void_p(self._fmu.component)

    def _expect_supported(self) -> None:
        """Raise `UsageError` for an FMU with features that are not supported."""
        if self.model.version != self.version:
            found = self.description.fmiVersion
            raise UsageError(f"{self.path}: FMI {found}; expected FMI {self.version}.0")

    def _access(self, action: str, type: str) -> str:
        """The name of the function that does an action, Get or Set, on variables of a type."""
        return f"fmi{self.version}{action}{self.enumerations if type == 'Enumeration' else type}"

    def _transfer(self, function: str, references: Sequence[int], values: Numbers) -> Transfer:
        """A call of a function of `_access` that transfers `values`."""
        of = (ctypes.c_uint32 * len(references))(*references)
        at = (np.ctypeslib.as_ctypes_type(values.dtype) * len(values)).from_buffer(values)  # type: ignore[arg-type]
        counts = (ctypes.c_size_t(len(values)),) if self.counts_values else ()
        arguments = (self._component, of, ctypes.c_size_t(len(references)), at, *counts)
        call = self.guarded(self._library[function])  # without argument types, by which ctypes would convert
        failure, otherwise = self.failure, self._refused_values

        def transfer() -> None:
            if (status := call(*arguments)) > slaves.WARNING:
                raise failure(function, status, otherwise(function, status, references))

        return transfer

    def _refused_values(self, function: str, status: int, references: Sequence[int]) -> str:
        """Why a call without a message failed, with the variables that it transfers."""
        names = [
            v.name
            for v in self.variables.values()
            if v.reference in references and function in (self._access("Get", v.type), self._access("Set", v.type))
        ]
        return (
            self.problem()
            or f"returned {slaves.status_name(self.model.version, status)}, without a message, for {listed(names)}"
        )

    def guarded(self, call: Callable[..., int]) -> Callable[..., int]:
        """A function of the FMU that restores the rounding mode after each call."""
        guard = self.guard
        if guard is None:
            return call

        def called(*arguments: Any) -> int:
            status = call(*arguments)
            self._restore_rounding(guard)
            return status

        return called

    def _put(self, variable: Variable, value: Value) -> None:
        if isinstance(value, str):
            self._call("setString", [variable.reference], [value])
        else:
            self.writer((variable.name,), np.array([float(value)]))()

    def _call(self, method: str, *args: Any, **kwargs: Any) -> Any:
        self._expect_alive()
        try:
            return getattr(self._fmu, method)(*args, **kwargs)
        except FMICallException as error:
            raise self.failure(error.function, error.status) from None
        finally:
            if self.guard is not None and method in self.state_calls:  # as often as steps
                self._restore_rounding(self.guard)
            else:
                self.restore_globals()

    def _expect_alive(self) -> None:
        if self.failed:
            raise SimulatorError(f"{self.name}: the FMU has failed and is not called again")

    def _expect_state(self) -> None:
        if not self.model.saves_state:
            raise UsageError(f"{self.name}: {self.model.name} {NO_STATE}")

    def collect_warnings(self) -> None:
        """Process the messages of the FMU: keep the warnings."""
        for status, _, message in self._messages:
            if status == slaves.WARNING:
                self._keep_warning(message.decode("utf-8", "replace"))
        self._messages.clear()

    def _keep_warning(self, text: str) -> None:
        if len(self.warnings) < _MAX_WARNINGS:
            self.warnings.append(f"{self.name}: {text}")
        elif len(self.warnings) == _MAX_WARNINGS:
            self.warnings.append(f"{self.name} ({self.model.name}): further warnings of this FMU are not kept")

    def problem(self) -> str | None:
        """Why a call fails that the FMU itself did not refuse; None if it did."""
        return None

    def failure(self, function: str, status: int, otherwise: str | None = None) -> SimulatorError:
        """The error for a call that failed, with the message that the FMU logged; `otherwise` if it logged none."""
        self.failed = True
        diverged = [m for m in self._messages if m[0] > slaves.WARNING and m[1] == DIVERGENCE_CATEGORY]
        silent = f"returned {slaves.status_name(self.model.version, status)}, without a message"
        summary, details = slaves.failure_text(diverged or self._messages, otherwise or self.problem() or silent)
        if diverged and summary.partition(" = ")[0] in self.model.variables:
            return SimulatorError(f"{self.name}.{summary}", divergence=True, details=details)
        if not diverged and self._names_initial_value(summary):
            return RefusedValueError(f"{self.name}.{summary}", details=details)
        return SimulatorError(self.reported(function, summary), divergence=bool(diverged), details=details)

    def reported(self, function: str, what: str) -> str:
        """The text of an error of a call."""
        return f"{self.name} ({self.model.name}): {function}: {what}"

    def _stopped_step(self, function: str, end: float, *, reached: float, ends: bool) -> StoppedStepError:
        """The error for a step to `end` [s] of an FMU that stopped at `reached` [s]."""
        self.stopped = True
        at = f" at {reached:g} s" if math.isfinite(reached) else ""
        what = f"ends the run{at}" if ends else f"discards the step to {end:g} s"
        summary, details = slaves.failure_text(self._messages, "")
        self.collect_warnings()
        return StoppedStepError(
            self.reported(function, f"{what}: {summary}" if summary else what),
            ends=ends, whole=math.isclose(reached, end, rel_tol=_AT_END, abs_tol=_AT_END), details=details,
        )  # fmt: skip

    def _names_initial_value(self, text: str) -> bool:
        """Whether the message `NAME = VALUE: expected …` is about a variable, or a vector of one, that was set."""
        name, equals, _ = text.partition(" = ")
        vector = name.partition(".{")[0]
        return bool(equals) and any(other == name or other.startswith(f"{vector}.") for other in self._initial_values)


def _is_used(file: str) -> bool:
    """Whether an FMU of this project's kit reads a file of its archive when it runs."""
    return not file.startswith(_NOT_USED)
