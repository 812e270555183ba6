"""Instances of FMUs for model exchange, of those whose events the importer processes, and of partitions: adapter.c."""

import ctypes
import functools
import math
from collections.abc import Mapping, Sequence
from fractions import Fraction
from io import BytesIO
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from orchestration.components.fmi.access import SCHEDULED, USUAL, Access, Interface
from orchestration.components.fmi.fmi2 import Fmi2Instance
from orchestration.components.fmi.fmi3 import Fmi3Instance, StepsWithEnd
from orchestration.components.fmi.read_description import Model
from orchestration.components.fmi.slaves import WARNING
from orchestration.components.fmi.transfers import Numbers
from orchestration.foundation.basics.c_structures import (
    address,
    compiled_library,
    constants,
    declared,
    expect_same_sizes,
)
from orchestration.foundation.basics.errors import SimulatorError, UsageError
from orchestration.foundation.basics.simulator import Floats
from orchestration.foundation.basics.times import NANOSECONDS, exact_nanoseconds

SOURCE = Path(__file__).with_name("adapter.c")
TOLERANCE = 1e-6
"""Relative tolerance of the solver where neither the component nor the FMU states one"""
_STAGES, _MOST_CLOCKS = 7, 64

_EVENTS = {"enter_event": "EnterEventMode", "update": "UpdateDiscreteStates"}
_STEP = {"leave_event": "EnterStepMode", "step": "DoStep"}
_EXCHANGE = {
    "leave_event": "EnterContinuousTimeMode", "set_time": "SetTime", "set_states": "SetContinuousStates",
    "get_states": "GetContinuousStates", "derivatives": "GetContinuousStateDerivatives",
    "indicators": "GetEventIndicators", "nominals": "GetNominalsOfContinuousStates",
    "completed": "CompletedIntegratorStep",
}  # fmt: skip
_FUNCTIONS: Mapping[Interface, Mapping[str, str]] = {
    "event-mode": {**_EVENTS, **_STEP},
    "model-exchange": {**_EVENTS, **_EXCHANGE},
    SCHEDULED: {"activate": "ActivateModelPartition"},
}
"""Fields of the adapter, and the functions of the FMU in them"""
_IN_FMI2 = {"UpdateDiscreteStates": "NewDiscreteStates", "GetContinuousStateDerivatives": "GetDerivatives"}
_TYPES_OF_FMI2 = {"Float64": "Real", "Int32": "Integer", "Boolean2": "Boolean"}
_IN_ADAPTER = {name: place for place, name in _TYPES_OF_FMI2.items()}

_PROBLEMS = {
    "ENDLESS_UPDATES": "asks for another update of its discrete states 1000 times at {0:g} s; expected an end",
    "ENDLESS_EVENTS": "has 10000 events in one step, the last at {0:.12g} s; expected fewer",
    "NO_STEP": "no step of the solver, however short, is accurate at {0:.12g} s",
    "ENDLESS_STEPS": "its solver has taken 10000000 steps, up to {0:.12g} s; expected fewer: a larger tolerance, or "
    "solver = cvode for a stiff model",
    "NO_ROOM": "no memory for its events",
}


@functools.cache
def library() -> Any:
    """The functions of adapter.c; raises `QuadcosimError` with the reason if they are not available."""
    sources = {SOURCE.name: SOURCE.read_bytes()}
    loaded = compiled_library("adapter", sources)
    expect_same_sizes(loaded, _types())
    pointer, number = ctypes.c_void_p, ctypes.c_double
    loaded.step.argtypes = (pointer, number, number, ctypes.c_bool, pointer, pointer, pointer, pointer)
    for name in ("begin", "settle", "restored", "empty", "release"):
        getattr(loaded, name).argtypes = (pointer,)
    size = ctypes.c_size_t
    loaded.keep_values.argtypes = (pointer, ctypes.c_int, ctypes.c_char_p, size, ctypes.c_char_p, size)
    loaded.size_of.restype = size
    loaded.set_followed.argtypes = (pointer, number)
    return loaded


@functools.cache
def _types() -> dict[str, Any]:
    return declared(SOURCE.read_text(encoding="utf-8"))


@functools.cache
def _constants() -> dict[str, int]:
    return constants(SOURCE.read_text(encoding="utf-8"))


class AdaptedInstance(StepsWithEnd):
    """An instance in event mode, or for model exchange, that is called as one for co-simulation."""

    step_name: ClassVar[str] = "step"
    _cvode: Any = None
    """the solver beside that of adapter.c; None: there is none"""
    _intervals: tuple[float, float] | None = None
    """period and offset of the clock of every sample [s]; None: those that the FMU states"""

    def _expect_supported(self) -> None:
        super()._expect_supported()
        library()

    def _called(self) -> tuple[Any, ctypes.c_void_p]:
        self._clocked: list[tuple[Numbers, Numbers]] = []  # start values, and the values of the last tick
        self._adapter = a = _types()["Adapter"](fmu=self._fmu.component, version=self.version, next=math.inf)
        if self.model.interface == "model-exchange":
            a.states, a.crossings = self._sizes()
        for field, function in _FUNCTIONS[self.model.interface].items():
            if self._is_called(field):
                setattr(a, field, self._address_of(function))
        for name, place in self._accesses().items():
            a.get[place], a.set[place] = self._address_of(f"Get{name}"), self._address_of(f"Set{name}")
        self._memory = {
            "x": np.zeros(a.states), "y": np.zeros(a.states), "k": np.zeros(_STAGES * a.states),
            "nominal": np.ones(a.states), "z": np.zeros(a.crossings), "z_next": np.zeros(a.crossings),
        }  # fmt: skip
        for field, array in self._memory.items():
            setattr(a, field, address(array))
        if self.model.access.solver == "cvode":
            from orchestration.components.fmi.cvode import Cvode  # not before: loads its libraries

            self._cvode = Cvode(self._fmu, a, self.version, library().set_followed)
            a.solver = ctypes.cast(self._cvode.function, ctypes.c_void_p).value
        if self.model.ticking:
            self._make_clocks_tick()
        self._load_step(library())
        return library(), ctypes.c_void_p(ctypes.addressof(a))

    def _make_clocks_tick(self) -> None:
        a, ticking = self._adapter, self.model.ticking
        if len(ticking) > _MOST_CLOCKS:
            raise UsageError(f"{self.path}: has {len(ticking)} clocks: expected at most {_MOST_CLOCKS}")
        a.set_clock, a.clocks = self._address_of("SetClock"), len(ticking)
        for i, clock in enumerate(ticking):
            a.clock[i], a.ratio[i] = clock.reference, 1  # until the samples are known
        if a.activate:
            return  # values are read at the end of each job alone
        bits = {clock.reference: 1 << i for i, clock in enumerate(ticking)}
        numbers, kinds = _constants(), self._accesses()
        table = []
        for variable in self.description.modelVariables:
            clocks = sum(bits[clock.valueReference] for clock in variable.clocks or ())
            kind = self.enumerations if variable.type == "Enumeration" else variable.type
            if not clocks or variable.causality not in ("output", "local") or kind not in kinds:
                continue
            starts = self._layout.start_values(variable.name)
            self._clocked.append((starts, starts.copy()))
            table.append((numbers[kind], variable.valueReference, len(starts), clocks, address(self._clocked[-1][1])))
        self._table = (_types()["Clocked"] * len(table))(*table)
        a.clocked, a.clocked_count = ctypes.addressof(self._table), len(table)

    def set_clock(self, period: float, offset: float, *, late: bool) -> None:
        """As `Instance`."""
        a, ticking = self._adapter, self.model.ticking
        base, first = _exact(period, ticking[0].interval), _exact(offset, ticking[0].shift)
        for i, clock in enumerate(ticking):
            interval = base if i == 0 or clock.interval is None else clock.interval * NANOSECONDS
            shift = first if i == 0 or clock.interval is None else clock.shift * NANOSECONDS
            ratio, after = interval / base, (shift - first) / base
            if ratio.denominator != 1 or after.denominator != 1 or after < 0:
                raise UsageError(
                    f"{self.name}: its clock {clock.name} ticks every {float(clock.interval or 0):g} s from "
                    f"{float(clock.shift):g} s; expected multiples of the period of {ticking[0].name}, {period:g} s"
                )
            a.ratio[i], a.shift[i] = int(ratio), int(after)
        a.starts_late = int(late)
        self._intervals = (period, offset)

    def follow(self, inputs: Sequence[str], times: Floats, values: Floats) -> None:
        """As `Instance`."""
        a, types, numbers = self._adapter, _types(), _constants()
        parts = self._layout.parts(inputs, np.zeros(len(inputs)), shared=self._arrays)
        references = [np.array(part.references, dtype=np.uint32) for part in parts]
        times, values = np.rint(times * NANOSECONDS) / NANOSECONDS, np.ascontiguousarray(values)  # as instants
        rows = [
            types["Followed"](
                type=numbers[_IN_ADAPTER.get(part.type, part.type)], references_count=len(of), count=len(part.buffer),
                inputs=len(part.places), references=address(of), values=address(part.buffer),
                places=address(part.places), columns=address(part.array_places),
            )
            for part, of in zip(parts, references)
        ]  # fmt: skip
        table = (types["Followed"] * len(rows))(*rows)
        self._followed = parts, references, times, values, table
        a.start, a.rows_time, a.rows = self.start_time, address(times), address(values)
        a.rows_count, a.columns_count = values.shape
        a.followed, a.followed_count = ctypes.addressof(table), len(table)

    def _sizes(self) -> tuple[int, int]:
        """The numbers of its continuous states and event indicators."""
        if self.version == 2:
            return int(self.description.numberOfContinuousStates), int(self.description.numberOfEventIndicators)
        return self._fmu.getNumberOfContinuousStates(), self._fmu.getNumberOfEventIndicators()

    def _is_called(self, field: str) -> bool:
        """Whether a function is one that the FMU needs."""
        if field == "completed":
            of = self.model.capabilities
            needed = of.needsCompletedIntegratorStep if self.version == 3 else not of.completedIntegratorStepNotNeeded
            return bool(needed)
        of_states = ("set_states", "get_states", "derivatives", "nominals")
        count = {**dict.fromkeys(of_states, self._adapter.states), "indicators": self._adapter.crossings}
        return bool(count.get(field, 1) > 0)

    def _accesses(self) -> Mapping[str, int]:
        """The places of functions for values in the adapter, by type as in their names."""
        numbers = _constants()
        if self.version == 2:
            return {name: numbers[place] for place, name in _TYPES_OF_FMI2.items()}
        return {name: numbers[name] for name in self.stored if name in numbers}

    def _address_of(self, function: str) -> int:
        """The address of a function of the FMU, by its name in FMI 3.0 without the prefix."""
        name = _IN_FMI2.get(function, function) if self.version == 2 else function
        return ctypes.cast(self._fmu.dll[f"fmi{self.version}{name}"], ctypes.c_void_p).value or 0

    # -- a run ---------------------------------------------------------------------------------------------------

    def _enter(self, start: float, stop: float | None) -> None:
        self._adapter.now = start
        super()._enter(start, stop)  # type: ignore[safe-super]  # of the class of its version
        self._set_interval()

    def _set_interval(self) -> None:
        """Tell the FMU the interval of the clock of every sample, and another shift than it declares."""
        base = self.model.ticking[:1]
        if self._intervals is not None and base[0].variability != "constant":
            reference, period, offset = (ctypes.c_uint32 * 1)(base[0].reference), *self._intervals
            self._call("setIntervalDecimal", reference, (ctypes.c_double * 1)(period))
            if offset != float(base[0].shift):
                self._call("fmi3SetShiftDecimal", self._fmu.component, reference, 1, (ctypes.c_double * 1)(offset))

    def exit_initialization(self) -> None:
        """As `NativeInstance`, and the first update of its discrete states."""
        super().exit_initialization()
        self._adapter.tolerance = self._tolerance or TOLERANCE
        self._do("begin")

    def reset(self) -> None:
        """As `NativeInstance`."""
        super().reset()
        self._continue(now=0.0, next=math.inf, h=0.0, events=0, ends=0, samples=0)
        self._adapter.running = self._adapter.in_event = self._adapter.followed_count = self._adapter.rows_count = 0
        for starts, values in self._clocked:
            values[:] = starts

    def save(self) -> bytes:
        """As `NativeInstance`, with what `adapter.c` knows."""
        own = self.own_state()
        return len(own).to_bytes(8, "little") + own + super().save()

    def restore(self, state: bytes) -> None:
        """As `NativeInstance`."""
        begin = 8 + int.from_bytes(state[:8], "little")
        super().restore(state[begin:])
        self.restore_own(state[8:begin])

    def slopes(self, outputs: Sequence[str], inputs: Sequence[str]) -> Floats | None:
        """As `NativeInstance`, of an FMU that has left event mode."""
        self._do("settle")
        return super().slopes(outputs, inputs)

    def set_states(self, values: Floats) -> None:
        """Put it at other continuous states, by model exchange, until it is stepped."""
        self._do("settle")
        count = len(values)
        if count:
            self._call("setContinuousStates", (ctypes.c_double * count)(*values.tolist()), count)

    def own_state(self) -> bytes:
        """What `adapter.c` knows beside the state of the FMU, which leaves event mode."""
        self._do("settle")
        a = self._adapter
        own = np.array([a.now, a.next, a.h, a.events, a.ends, a.samples, a.starts_late, a.waiting_count])
        waiting = (_types()["Waiting"] * a.waiting_count).from_address(a.waiting) if a.waiting_count else ()
        parts = [own.tobytes(), *(values.tobytes() for _, values in self._clocked)]
        for each in waiting:
            sizes = 4 * each.references_count, self._size_of(each.type) * each.count
            parts.append(np.array([each.type, each.references_count, each.count]).tobytes())
            parts += [ctypes.string_at(place, n) for place, n in zip((each.references, each.values), sizes)]
        return b"".join(parts)

    def restore_own(self, state: bytes) -> None:
        """Restore that, after the state of the FMU."""
        reader = BytesIO(state)
        now, following, h, *counts = np.frombuffer(reader.read(8 * 8)).tolist()
        events, ends, samples, late, waiting = map(int, counts)
        self._continue(now=now, next=following, h=h, events=events, ends=ends, samples=samples, starts_late=late)
        for _, values in self._clocked:
            values[:] = np.frombuffer(reader.read(values.nbytes), dtype=values.dtype)
        self._adapter.tolerance = self._tolerance or TOLERANCE
        self._do("restored")
        library().empty(self._component)
        for _ in range(waiting):
            kind, references, count = np.frombuffer(reader.read(3 * 8), dtype=np.int64).tolist()
            of, content = reader.read(4 * references), reader.read(self._size_of(kind) * count)
            library().keep_values(self._component, kind, of, references, content, count)

    def take_events(self) -> Floats:
        """As `Instance`."""
        a = self._adapter
        times = (ctypes.c_double * a.noted_count).from_address(a.noted) if a.noted_count else ()
        taken: Floats = np.array([a.events - a.noted_count, *(time - self.start_time for time in times)])
        a.noted_count = 0
        return taken

    @staticmethod
    def _size_of(kind: int) -> int:
        """The bytes of a value of a type of the adapter."""
        return int(library().size_of(kind))

    def close(self) -> None:
        """As `NativeInstance`."""
        super().close()
        if hasattr(self, "_adapter"):
            library().release(ctypes.byref(self._adapter))

    def problem(self) -> str | None:
        """As `NativeInstance`."""
        numbers = {number: name for name, number in _constants().items() if name in _PROBLEMS}
        name = numbers.get(self._adapter.problem)
        if name is None and self._cvode is not None:
            failure: str | None = self._cvode.failure
            return failure
        return None if name is None else _PROBLEMS[name].format(self._adapter.now)

    def _continue(self, **fields: Any) -> None:
        for name, value in fields.items():
            setattr(self._adapter, name, value)
        self._adapter.problem = self._adapter.noted_count = 0
        self._adapter.fresh = 1

    def _do(self, function: str) -> None:
        """Call a function of the adapter that has no more arguments."""
        self._expect_alive()
        status = self.guarded(getattr(self._library, function))(self._component)
        if status > WARNING:
            raise self.failure(function, status)


def _exact(time: float, declared: Fraction | None) -> Fraction:
    """A time [s] in nanoseconds: as the FMU declares it, if that is the same float."""
    return exact_nanoseconds(time) if declared is None or float(declared) != time else declared * NANOSECONDS


class Adapted2(AdaptedInstance, Fmi2Instance):
    """One of FMI 2.0."""

    only_calls = True


class Adapted3(AdaptedInstance, Fmi3Instance):
    """One of FMI 3.0."""

    only_calls = True


class Partition(Adapted3):
    """A partition of an FMU for scheduled execution: each step is a job.

    The first one of an instance owns it: it enters and leaves initialisation, saves the state, and frees it.
    """

    only_calls = True

    def __init__(
        self, path: Path, instance_name: str, access: Access = USUAL, owner: "Partition | None" = None
    ) -> None:
        """`owner`: the first partition of the instance; None: this one."""
        self._owner = owner
        self._has_entered = False
        unpacked = None if owner is None or owner._folder is None else owner._folder.path
        super().__init__(path, instance_name, access, unpacked=unpacked)

    def beside(self, instance_name: str, access: Access) -> "Partition":
        """As `Instance`."""
        return Partition(self.path, instance_name, access, self)

    def _instantiate(self, folder: Path) -> Any:
        if self._owner is None:
            return super()._instantiate(folder)
        self._messages = self._owner._messages
        return self._owner._fmu

    def _enter(self, start: float, stop: float | None) -> None:
        first = self._owner or self
        if not first._has_entered:
            first._has_entered = True
            super()._enter(start, stop)
        else:
            self._adapter.now = start
            self._set_interval()

    def enter_initialization(self, start: float, stop: float) -> None:
        """As any instance; its inputs are what is set from here on."""
        super().enter_initialization(start, stop)
        library().empty(self._component)

    def exit_initialization(self) -> None:
        """As any instance; at the first partition that leaves it, the instance does."""
        first = self._owner or self
        if first._has_entered:
            first._has_entered = False
            super().exit_initialization()
        else:
            self._initial_values.clear()
            self._do("begin")

    def reset(self) -> None:
        """As any instance."""
        super().reset()
        self._has_entered = False

    def save(self) -> bytes:
        """As any instance; that of the first partition is the whole state of the FMU."""
        return super().save() if self._owner is None else self.own_state()

    def restore(self, state: bytes) -> None:
        """As any instance."""
        if self._owner is None:
            super().restore(state)
        else:
            self.restore_own(state)

    def failure(self, function: str, status: int, otherwise: str | None = None) -> SimulatorError:
        """As any instance; no partition is called after it."""
        (self._owner or self).failed = True
        return super().failure(function, status, otherwise)

    def close(self) -> None:
        """As any instance; only the first partition frees what they share."""
        self.failed |= self._owner is not None
        super().close()


def adapted(model: Model) -> type[AdaptedInstance]:
    """The class of the instances of an FMU."""
    if model.interface == SCHEDULED:
        return Partition
    return Adapted2 if model.version == 2 else Adapted3
