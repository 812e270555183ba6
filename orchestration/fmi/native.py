"""An FMU loaded into this process, through fmpy: what instances of FMI 2.0 and FMI 3.0 have in common.

Every array of a step is allocated once, and every argument of a transfer is made once, as C has it.
"""

import ctypes
import math
import tempfile
from abc import abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar
from weakref import WeakKeyDictionary

import fmpy
import numpy as np
import numpy.typing as npt
from fmpy.fmi1 import FMICallException

from orchestration.basics import scratch
from orchestration.basics.errors import QuadcosimError, RefusedValueError, SimulatorError, StoppedStepError, UsageError
from orchestration.basics.scratch import Scratch
from orchestration.basics.simulator import Floats, Transfer
from orchestration.fmi import pythonfmu
from orchestration.fmi.instance import Instance
from orchestration.fmi.messages import WARNING, Messages, words
from orchestration.fmi.model import Variable, read_model
from orchestration.fmi.slaves import binary_folders, folder_here, instantiate, loaded
from orchestration.fmi.surroundings import FOLDER, ROUNDING, Surroundings, sentence
from orchestration.fmi.values import Value, number_of, same, taken

DIVERGENCE_CATEGORY = b"divergence"
_AT_END = 1e-9
"""Relative and in seconds: what an FMU that adds up its steps may miss the end of one by"""

_FOR_READERS = ("documentation/", "sources/")
"""What an FMU of this project's kit never opens"""

Numbers = npt.NDArray[Any]


@dataclass(frozen=True, kw_only=True)
class Part:
    """Variables that one call transfers: all scalars of a type, or one array."""

    type: str
    references: tuple[int, ...]
    buffer: Numbers
    """what is transferred, in the order of the references"""
    asked: npt.NDArray[np.int64]
    """places in the names that were asked for"""
    places: npt.NDArray[np.int64]
    """of the same in the buffer"""


@dataclass(frozen=True, kw_only=True)
class Call:
    """One call of a transfer, for a loop that makes it without Python."""

    function: str
    part: Part
    in_place: bool
    """whether the buffer is the array of the transfer"""


class NativeInstance(Instance):
    """One instance of a co-simulation FMU in this process.

    The FMU's log is on and collected, so that a failed call raises `SimulatorError` with the FMU's own
    words. After a failed call the instance is never called again, not even to free it: FMI leaves what
    would happen undefined.
    """

    def __init__(self, path: Path, instance_name: str) -> None:
        self.path = path
        self.name = instance_name
        self.warnings: list[str] = []
        self.failed = self.stopped = False
        self._messages = Messages()
        self._given: dict[str, Value] = {}  # until initialisation ends, as then the FMU has taken all of it
        self._arrays: dict[int, Numbers] = {}  # what was last set of arrays, by reference: a call sets a whole one
        self._calls: WeakKeyDictionary[Transfer, tuple[Call, ...]] = WeakKeyDictionary()
        self._folder: Scratch | None = None
        self.model = read_model(path)
        self._tolerance = self.model.tolerance
        self._expect_supported()
        self.guard = None if self.model.is_of_this_kit else Surroundings()
        try:
            folder_here(self.model.version, binary_folders(path))
        except QuadcosimError as error:
            raise QuadcosimError(f"{path}: {error}") from None
        try:
            self._folder = scratch.temporary()
            fmpy.extract(str(path), str(self._folder.path), include=_is_run if self.model.is_of_this_kit else None)
            pythonfmu.expect_readable_place(self._folder.path)
            self._fmu = self._instantiated(self._folder.path)
            self.put_back()
        except Exception as error:
            self.failed = True
            self.close()
            if (
                isinstance(error, OSError) and error.errno is not None
            ):  # of the disk: libraries that fail have no number
                what = f"cannot be unpacked in {tempfile.gettempdir()}, which TMPDIR names: {error.strerror}"
                raise QuadcosimError(f"{path}: {what}") from error
            said, _ = words(self._messages, str(error))
            raise QuadcosimError(f"{path}: expected a co-simulation FMU that loads here: {said}") from error
        self._component = ctypes.c_void_p(self._fmu.component)

    # -- what differs between versions ---------------------------------------------------------------------------

    stored: ClassVar[Mapping[str, type[np.generic]]]
    """by type, what holds its values"""
    counts_values: ClassVar[bool]
    """whether a call says how many values it transfers beside how many references: arrays have more"""
    said: tuple[Any, ...] = ()
    """where an FMU of FMI 3.0 says how a step has ended"""
    state_calls: tuple[str, str, str, str, str]
    """fmpy's names of the calls that get, serialise, free, deserialise and set a state"""

    @abstractmethod
    def _expect_supported(self) -> None:
        """Raise `UsageError` for an FMU that needs what is not done here."""

    @abstractmethod
    def _know(self, library: Any) -> None:
        """Keep what every step needs of the FMU's library."""

    @abstractmethod
    def _enter(self, start: float, stop: float | None) -> None:
        """Into initialisation mode, with the tolerance if there is one; `stop` is None if no end is defined."""

    @abstractmethod
    def step_error(self, status: int, end: float) -> SimulatorError:
        """What the last step, to `end` [s], has come to that was not simply done; `status` is what the call gave."""

    @abstractmethod
    def _access(self, action: str, type: str) -> str:
        """The function that does an action, Get or Set, to variables of a type."""

    # -- a run ---------------------------------------------------------------------------------------------------

    def enter_initialization(self, start: float, stop: float) -> None:
        """As `Simulator`; what the FMU has lost is set once more."""
        self._expect_alive()
        self._enter(start, None if math.isinf(stop) else stop)
        for name, value in self._lost():
            self._put(self.variable(name), value)
        for name, value in self._lost():
            self.warnings.append(f"{self.name}.{name}: was set to {value}, the FMU has {self.get(name)}")

    def _lost(self) -> list[tuple[str, Value]]:
        """What was set and is not there any more."""
        numbers = [name for name, value in self._given.items() if not isinstance(value, str)]
        values = np.zeros(len(numbers))
        self.reader(numbers, values)()
        kept: dict[str, Value] = dict(zip(numbers, values.tolist()))
        return [
            (name, value)
            for name, value in self._given.items()
            if not same(self.variable(name), value, kept[name] if name in kept else self.get(name))
        ]

    def exit_initialization(self) -> None:
        """End initialisation."""
        self._call("exitInitializationMode")
        self._given.clear()
        self.collect_warnings()

    def reset(self) -> None:
        """Back to the state after instantiation, all parameters at their defaults."""
        self._call("reset")
        self._given.clear()
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
        """Put back what `save` gave."""
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
        """A call that puts the values of the variables `names` into `into`; a Boolean is 0 or 1."""
        parts = self._parts(names, into)
        calls = [(self._transfer(self._access("Get", x.type), x.references, x.buffer), x) for x in parts]
        if len(parts) == 1 and parts[0].buffer is into:
            return self._known(calls[0][0], "Get", parts, into)

        def read() -> None:
            for call, part in calls:
                call()
                into[part.asked] = part.buffer[part.places]

        return self._known(read, "Get", parts, into)

    def writer(self, names: Sequence[str], source: Floats) -> Transfer:
        """A call that sets the variables `names` from `source`.

        A Boolean is true for what is not 0; an Integer or Enumeration takes the nearest whole number. Raises
        `SimulatorError` for one that it does not hold.
        """
        parts = self._parts(names, source, shared=self._arrays)
        calls = [(self._transfer(self._access("Set", x.type), x.references, x.buffer), x) for x in parts]
        if len(parts) == 1 and parts[0].buffer is source:
            return self._known(calls[0][0], "Set", parts, source)
        converters = [self._converter([names[i] for i in part.asked], part.buffer.dtype) for part in parts]

        def write() -> None:
            for (call, part), converted in zip(calls, converters):
                part.buffer[part.places] = converted(source[part.asked])
                call()

        return self._known(write, "Set", parts, source)

    def set(self, name: str, value: Value) -> None:
        """Set one variable, converted to its type; raises `UsageError` for a value it cannot take."""
        self._expect_alive()
        variable = self.variable(name)
        if variable.causality == "structuralParameter":
            raise UsageError(f"{self.name}.{name}: is a structural parameter, which is not supported")
        given = taken(variable, value, f"{self.name}.{name}")
        self._given[name] = given
        self._put(variable, given)

    def set_tolerance(self, tolerance: float) -> None:
        """Give its solver a relative tolerance, before initialisation, instead of that of its declared experiment."""
        self._tolerance = tolerance

    def get(self, name: str) -> Value:
        """The value of one variable."""
        self._expect_alive()
        variable = self.variable(name)
        if variable.kind == "String":
            text = self._call("getString", [variable.reference])[0]
            return text.decode("utf-8", "replace") if isinstance(text, bytes) else str(text)
        value = np.zeros(1)
        self.reader((name,), value)()
        return bool(value[0]) if variable.kind == "Boolean" else float(value[0])

    # -- what it shares with the others of this process ------------------------------------------------------------

    guard: Surroundings | None
    """what is put back after its calls; None for an FMU of this project's kit, which leaves it alone"""

    def put_back(self) -> None:
        """What it has changed for the whole process is as it was, and one more warning says so."""
        if self.guard is not None:
            if self.guard.put_back_rounding():
                self.has_changed(ROUNDING)
            if self.guard.put_back_folder():
                self.has_changed(FOLDER)

    def has_changed(self, what: str) -> None:
        """Warn that it has changed something, once."""
        warning = sentence([f"{self.name} ({self.model.name})"], what)
        if warning not in self.warnings:
            self.warnings.append(warning)

    # -- for a loop that makes the calls without Python ------------------------------------------------------------

    def calls_of(self, transfer: Transfer) -> Sequence[Call]:
        """What a call of `reader` or `writer` does."""
        return self._calls[transfer]

    def address(self, function: str) -> int:
        """Where a function of the FMU is in memory."""
        return ctypes.cast(self._fmu.dll[function], ctypes.c_void_p).value or 0

    @property
    def handle(self) -> int:
        """The instance, as its functions are given it."""
        return self._component.value or 0

    @property
    def messages_waiting(self) -> ctypes.c_int64:
        """How many messages have not been heard."""
        return self._messages.waiting

    def _known(self, transfer: Transfer, action: str, parts: Sequence[Part], array: Floats) -> Transfer:
        self._calls[transfer] = tuple(
            Call(function=self._access(action, part.type), part=part, in_place=part.buffer is array) for part in parts
        )
        return transfer

    # -- inside --------------------------------------------------------------------------------------------------

    def _instantiated(self, folder: Path) -> Any:
        """fmpy's instance of the FMU unpacked in `folder`, its messages collected."""
        described = self.description
        identifier = described.coSimulation.modelIdentifier
        fmu = loaded(self.model.version, folder, token=described.guid, identifier=identifier, name=self.name)
        instantiate(fmu, self._messages)
        self._know(fmu.dll)
        return fmu

    def _transfer(self, function: str, references: Sequence[int], values: Numbers) -> Transfer:
        """A call of a function of `_access` that transfers `values`."""
        of = (ctypes.c_uint32 * len(references))(*references)
        at = (np.ctypeslib.as_ctypes_type(values.dtype) * len(values)).from_buffer(values)  # type: ignore[arg-type]
        counts = (ctypes.c_size_t(len(values)),) if self.counts_values else ()
        arguments = (self._component, of, ctypes.c_size_t(len(references)), at, *counts)
        call = self.watched(self._fmu.dll[function])  # without the types by which ctypes would convert
        failure = self.failure

        def transfer() -> None:
            if call(*arguments) > WARNING:
                raise failure(function)

        return transfer

    def watched(self, call: Callable[..., int]) -> Callable[..., int]:
        """A function of the FMU, called so that others compute as they did before."""
        guard = self.guard
        if guard is None:
            return call

        def called(*arguments: Any) -> int:
            status = call(*arguments)
            if guard.put_back_rounding():
                self.has_changed(ROUNDING)
            return status

        return called

    def _put(self, variable: Variable, value: Value) -> None:
        if isinstance(value, str):
            self._call("setString", [variable.reference], [value])
        else:
            self.writer((variable.name,), np.array([float(value)]))()

    def _parts(self, names: Sequence[str], array: Floats, shared: dict[int, Numbers] | None = None) -> list[Part]:
        """What is called to transfer `names`; the array itself is transferred where it is as it is to be.

        Arrays lie in `shared`, from their start values on, since whoever sets an element sets them all.
        """
        if array.shape != (len(names),):
            raise ValueError(f"expected an array of {len(names)} values, got shape {array.shape}")
        groups: dict[tuple[str, int | None], list[tuple[int, Variable]]] = {}
        for i, name in enumerate(names):
            variable = self.model.variable(name, f"{self.name}.{name}")
            group = variable.reference if variable.length else None
            groups.setdefault((variable.type, group), []).append((i, variable))
        return [self._part(array, group, reference, shared) for (_, reference), group in groups.items()]

    def _part(
        self, array: Floats, group: list[tuple[int, Variable]], reference: int | None, shared: dict[int, Numbers] | None
    ) -> Part:
        first = group[0][1]
        asked = np.array([i for i, _ in group])
        if reference is None:
            references, places = tuple(v.reference for _, v in group), np.arange(len(group))
        else:
            references, places = (reference,), np.array([v.element for _, v in group])
        length = first.length or len(group)
        if (
            self.stored[first.type] is np.float64
            and np.array_equal(places, np.arange(len(array)))
            and length == len(array)
        ):
            buffer: Numbers = array
        elif reference is None or shared is None:
            buffer = np.zeros(length, dtype=self.stored[first.type])
        else:
            buffer = shared.setdefault(reference, self._start_of(first))
        return Part(type=first.type, references=references, buffer=buffer, asked=asked, places=places)

    def _start_of(self, element: Variable) -> Numbers:
        found = np.zeros(element.length, dtype=self.stored[element.type])
        for variable in self.variables.values():
            if variable.reference == element.reference and variable.start is not None:
                found[variable.element] = number_of(variable, variable.start)
        return found

    def _converter(self, names: Sequence[str], dtype: np.dtype[Any]) -> Callable[[Floats], Numbers]:
        """From what is written to what lies in memory."""
        if dtype.kind == "f":
            return lambda values: values
        if dtype.kind == "b" or self.variable(names[0]).kind == "Boolean":
            return lambda values: values != 0.0
        low, high = bounds_of(dtype)

        def whole(values: Floats) -> Numbers:
            rounded = np.rint(values)
            outside = ~((rounded >= low) & (rounded <= high))
            if outside.any():
                at = int(np.argmax(outside))
                raise SimulatorError(f"{self.name}.{names[at]} = {values[at]:g}: expected a number that {dtype} holds")
            return rounded

        return whole

    def _call(self, method: str, *args: Any, **kwargs: Any) -> Any:
        self._expect_alive()
        try:
            return getattr(self._fmu, method)(*args, **kwargs)
        except FMICallException as error:
            raise self.failure(error.function) from None
        finally:
            self.put_back()

    def _expect_alive(self) -> None:
        if self.failed:
            raise SimulatorError(f"{self.name}: the FMU has failed and is not called again")

    def _expect_state(self) -> None:
        if not self.model.saves_state:
            raise UsageError(
                f"{self.name}: {self.model.name} cannot save its state: its description does not declare that it can "
                "get, set and serialise it"
            )

    def collect_warnings(self) -> None:
        """Hear what the FMU has logged; of it, keep the warnings."""
        for status, _, message in self._messages:
            if status == WARNING:
                self.warnings.append(f"{self.name}: {message.decode('utf-8', 'replace')}")
        self._messages.clear()

    def failure(self, function: str, otherwise: str = "no message") -> SimulatorError:
        """The error for a call that failed, in the words that the FMU logged."""
        self.failed = True
        diverged = [m for m in self._messages if m[0] > WARNING and m[1] == DIVERGENCE_CATEGORY]
        summary, details = words(diverged or self._messages, otherwise)
        if not diverged and self._names_what_was_given(summary):
            return RefusedValueError(f"{self.name}.{summary}", details=details)
        return SimulatorError(
            f"{self.name} ({self.model.name}): {function}: {summary}", divergence=bool(diverged), details=details
        )

    def _stopped_step(self, function: str, end: float, *, reached: float, ends: bool) -> StoppedStepError:
        """The error for a step to `end` [s] of an FMU that has come to `reached` [s] and does not go on."""
        self.stopped = True
        at = f" at {reached:g} s" if math.isfinite(reached) else ""
        what = f"ends the run{at}" if ends else f"discards the step to {end:g} s"
        summary, details = words(self._messages, "")
        self.collect_warnings()
        return StoppedStepError(
            f"{self.name} ({self.model.name}): {function}: {what}" + (f": {summary}" if summary else ""),
            ends=ends, whole=math.isclose(reached, end, rel_tol=_AT_END, abs_tol=_AT_END), details=details,
        )  # fmt: skip

    def _names_what_was_given(self, text: str) -> bool:
        """Whether the message `NAME = VALUE: expected …` is about a variable, or a vector of one, that was set."""
        name, equals, _ = text.partition(" = ")
        vector = name.partition(".{")[0]
        return bool(equals) and any(given == name or given.startswith(f"{vector}.") for given in self._given)


def bounds_of(dtype: np.dtype[Any]) -> tuple[float, float]:
    """The smallest and the largest float that a type of whole numbers holds: the largest of 64 bits is no float."""
    of = np.iinfo(dtype)
    high = float(of.max)
    return float(of.min), high if int(high) <= of.max else math.nextafter(high, 0.0)


def _is_run(file: str) -> bool:
    """Whether an FMU of this project's kit needs a file of its archive to run."""
    return not file.startswith(_FOR_READERS)
