"""The base class of slaves: what FMI requires of an FMU and pythonfmu 0.7.0 leaves to its user.

A model declares its variables and defines `step`. The other methods are optional: `read_parameters`, `initialise`, and,
for state beside the variables, `internal_state` and `restore`. This class keeps the values in a list, checks every call
and turns any failure into one readable message.
"""

import contextlib
import enum
import functools
import math
import sys
from abc import abstractmethod
from collections.abc import Callable, Iterable, Mapping
from typing import Any, ClassVar, TypeVar
from xml.etree.ElementTree import Element

from pythonfmu.default_experiment import DefaultExperiment
from pythonfmu.enums import Fmi2Status
from pythonfmu.fmi2slave import Fmi2Slave

from fmu_kit import write_description
from fmu_kit.declared_names import expect_free_names, expect_variables
from fmu_kit.errors import DivergenceError, FmuError, require
from fmu_kit.failure import Failure, printf_safe, report
from fmu_kit.interface import Declaration, declarations_in, initial_values, variables_of
from fmu_kit.release_at_exit import release_at_exit
from fmu_kit.saved_state import State, deserialise, expect_state, serialise
from fmu_kit.scalar import FLOAT
from fmu_kit.variables import INDEX, Variable
from fmu_kit.variants import Value, with_fixed_values


class Phase(enum.IntEnum):
    """The phase of an instance's life cycle (FMI 2.0, section 4.2.4)."""

    INSTANTIATED = 0
    INITIALIZATION = 1
    STEPPING = 2
    TERMINATED = 3
    FAILED = 4


TIME_TOLERANCE = 1e-9
"""Relative; in seconds for times below one. Masters accumulate times, or round them"""

_Method = TypeVar("_Method", bound=Callable[..., Any])


def guarded(method: _Method) -> _Method:
    """Convert every exception of `method` into the readable failure of this instance."""

    @functools.wraps(method)
    def call(self: "Slave", *args: Any) -> Any:
        try:
            return method(self, *args)
        except Exception as error:
            raise self._failure_of(error) from None

    return call  # type: ignore[return-value]


class Slave(Fmi2Slave):  # type: ignore[misc]
    """A co-simulation slave with declared variables, checked calls and a complete saved state.

    Subclasses declare their variables as attributes (`fmu_kit.interface`) and define `step`. The class that is packaged
    must define `__init__` and `do_step` itself, or pythonfmu crashes on the second instance: the entry script that
    packaging writes does.
    """

    variables: ClassVar[tuple[Variable, ...]] = ()
    """The variables by value reference, Reals first."""
    fixed: ClassVar[Mapping[str, Value]] = {}
    """Parameters that are constants of the FMU, by their FMI names."""
    description: ClassVar[str]
    """Description of the FMU, in one line; default: the first sentence of the docstring."""
    initial_outputs_depend_on_inputs: ClassVar[bool | None] = None
    """Whether the outputs at the end of initialisation depend on the inputs; later ones never do directly.
    Default: they do if the model defines `initialise`."""
    initially_idle: ClassVar[frozenset[str]] = frozenset()
    """Inputs and parameters on which not even the initial outputs depend."""

    continuous_states: ClassVar[tuple[str, ...]] = ()
    """Attributes with the continuous states, of which `derivatives` returns the derivatives: a native FMU of such a
    slave offers model exchange too."""

    usual_parameters: ClassVar[Mapping[str, float | int | bool]] = {}
    """Values of parameters, by name, that a master sets when it computes many runs in SIMD lanes, where they differ
    from the start values: steps in lanes are optimised for these."""

    author: ClassVar[str] = ""
    license: ClassVar[str] = ""
    copyright: ClassVar[str] = ""
    """Attribution of the model; empty texts are left out of the description of the FMU."""
    default_experiment = DefaultExperiment(start_time=0.0, stop_time=30.0, step_size=0.01)
    # All other failures have no category: the native part logs them itself, and hides them from a master that selects
    # categories.
    log_categories: ClassVar[dict[str, str]] = {
        "logStatusWarning": "What the user should know about how the FMU is used.",
        "divergence": "Failures because the closed loop diverged: a state that is not finite, "
        "a virtual control without a desired attitude.",
    }

    def __init_subclass__(cls, **kwargs: Any) -> None:
        super().__init_subclass__(**kwargs)
        if "description" not in cls.__dict__ and (cls.__doc__ or not hasattr(cls, "description")):
            cls.description = _first_line(cls.__doc__ or cls.__name__)
        if "variables" in cls.__dict__:
            raise TypeError(
                f"{cls.__name__}.variables: expected variables as attributes, as fmu_kit.interface has them"
            )
        declared = declarations_in(cls)
        expect_free_names(cls, Slave, declared)
        if declared != getattr(cls, "_declared", None) or "fixed" in cls.__dict__:
            cls._declare(declared)  # else those of its base: pythonfmu 0.7.0 leaks the class of each instance
        elif "initial_dependencies" not in cls.__dict__:
            return
        for output in (v.name for v in cls.variables if v.causality == "output"):
            expect_variables(cls, f"initial_dependencies of {output}", cls.initial_dependencies(output) or ())

    @classmethod
    def _declare(cls, declared: list[Declaration]) -> None:
        cls.variables = with_fixed_values(cls.__name__, cls.fixed, variables_of(declared))
        cls._initial = initial_values(declared)
        cls._index = {v.name: i for i, v in enumerate(cls.variables)}
        for i, variable in enumerate(cls.variables):
            if cls._index[variable.name] != i:
                raise TypeError(f"{cls.__name__}.{variable.name}: expected one variable of this name")
        for each in declared:
            setattr(cls, each.attribute, each.at(cls._index[each.first]))
        cls._declared = declarations_in(cls)
        cls._own = tuple(each.attribute for each in declared if each.set_by_slave)
        cls._real_count = sum(v.type == "Real" for v in cls.variables)
        cls._readable = frozenset(range(cls._real_count))
        cls._with_start = frozenset(i for i, v in enumerate(cls.variables) if v.has_start)
        cls._inputs = frozenset(i for i, v in enumerate(cls.variables) if v.causality == "input")
        cls._tunable = frozenset(i for i, v in enumerate(cls.variables) if v.variability == "tunable")
        chosen = [(i, v.name) for i, v in enumerate(cls.variables) if v.items and v.is_settable]
        cls._indices = {i: cls._index[f"{name}{INDEX}"] for i, name in chosen}

    _declared: ClassVar[list[Declaration]]
    _own: ClassVar[tuple[str, ...]]
    """The attributes that a slave sets itself."""
    _initial: ClassVar[dict[str, str]]
    _index: ClassVar[dict[str, int]]
    _real_count: ClassVar[int]
    _readable: ClassVar[frozenset[int]]
    _with_start: ClassVar[frozenset[int]]
    _inputs: ClassVar[frozenset[int]]
    _tunable: ClassVar[frozenset[int]]
    _indices: ClassVar[dict[int, int]]
    """the Integer of each Enumeration"""

    def __init__(self, **kwargs: Any) -> None:
        super().__init__(**{"instance_name": type(self).__name__, **kwargs})
        # All imports are done: restore the host's import path, to which pythonfmu added. One call, which other threads
        # cannot interrupt; after a reset and while building there is nothing to remove.
        with contextlib.suppress(ValueError):
            sys.path.remove(self.resources)
        release_at_exit(self.resources, type(self).__name__)
        starts = [v.start for v in self.variables]
        self._reals: list[float] = [float(v) for v in starts[: self._real_count]]
        self._others: dict[int, int | bool] = {
            i: int(v) for i, v in enumerate(starts) if i >= self._real_count
        }  # all but Reals, by value reference
        self._phase = Phase.INSTANTIATED
        self._initialised = False
        self._start_time, self._stop_time = 0.0, math.inf
        self._reached: float | None = None  # start time of the next step; None before the first: any
        self._stale = True  # values were set that initialise() or step() has not read yet
        self._quickly_settable: frozenset[int] = frozenset()
        self._warned: list[str] = []
        self._has_failed = False  # of this object, whatever the phase of a restored state
        self._base_attributes = frozenset(vars(self))

    # -- methods of a model ------------------------------------------------------------------------------

    def read_parameters(self) -> None:
        """Read the parameters, each already within its bounds; raise `FmuError` for invalid combinations."""

    def initialise(self, t: float) -> None:
        """Compute the outputs at the start time `t` [s]; may be called again before initialisation ends.

        States have their initial values when it is called. Default: all other variables keep their start values.
        """

    @abstractmethod
    def step(self, t: float, h: float) -> None:
        """Advance from `t` to `t + h` [s] with the inputs held."""

    def derivatives(self, t: float, since: float) -> tuple[Any, ...]:
        """The derivatives of `continuous_states` at `t` [s], in their order; what else follows from these is set.

        What jumps at times is as it is from `since` [s] on, the time of the last event, until the next one.
        """
        raise NotImplementedError

    def next_jump(self) -> float:
        """The time [s] of the next event of model exchange; one that is over: there is none."""
        return -math.inf

    def internal_state(self) -> State:
        """The state of the model beside its variables, in JSON types; default: none."""
        kept = sorted(vars(self).keys() - self._base_attributes - {"_base_attributes"})
        if kept and type(self).read_parameters is Slave.read_parameters:
            raise FmuError(f"self.{kept[0]} is not saved: expected a Local instead, or internal_state and restore")
        return {}

    def restore(self, state: State) -> None:
        """Restore what `internal_state` returned, after the variables have been restored."""

    @classmethod
    def depends_initially(cls) -> bool:
        """Whether outputs depend on the inputs when initialisation ends."""
        declared = cls.initial_outputs_depend_on_inputs
        return cls.initialise is not Slave.initialise if declared is None else declared

    @classmethod
    def initial_dependencies(cls, output: str) -> frozenset[str] | None:
        """The inputs and parameters on which an output depends when initialisation ends; None: any of them.

        Default: a state depends on its initial value if the model does not define `initialise`; otherwise all outputs
        depend on all parameters, and on all inputs if `depends_initially`.
        """
        if cls.initialise is Slave.initialise:
            return frozenset({cls._initial[output]} if output in cls._initial else ())
        known = {v.name for v in cls.variables if v.causality == "parameter"}
        if cls.depends_initially():
            known |= {v.name for v in cls.variables if v.causality == "input"}
        return frozenset(known - cls.initially_idle)

    @property
    def is_fresh(self) -> bool:
        """Whether initialisation has not begun: then inputs and parameters may be set as attributes."""
        return self._phase is Phase.INSTANTIATED

    # -- messages of the model --------------------------------------------------------------------------

    def warn_once(self, key: str, text: str) -> None:
        """Log a warning, the first time only."""
        if key not in self._warned:
            self._warned.append(key)
            self.log(printf_safe(text), Fmi2Status.warning)

    # -- FMI ----------------------------------------------------------------------------------------------

    @guarded
    def setup_experiment(
        self, start_time: float, stop_time: float | None = None, tolerance: float | None = None
    ) -> None:
        """fmi2SetupExperiment; some versions of pythonfmu pass the start time alone."""
        self._expect(Phase.INSTANTIATED, "fmi2SetupExperiment")
        require(math.isfinite(start_time), "startTime", start_time, "a finite time")
        if stop_time is not None:
            require(stop_time >= start_time, "stopTime", stop_time, f"a time not before startTime = {start_time}")
        self._start_time, self._stop_time = start_time, math.inf if stop_time is None else stop_time

    @guarded
    def enter_initialization_mode(self) -> None:
        """fmi2EnterInitializationMode."""
        self._expect(Phase.INSTANTIATED, "fmi2EnterInitializationMode")
        self._phase = Phase.INITIALIZATION

    @guarded
    def exit_initialization_mode(self) -> None:
        """fmi2ExitInitializationMode: parameters are checked together here."""
        self._expect(Phase.INITIALIZATION, "fmi2ExitInitializationMode")
        self._initialise()
        self._phase = Phase.STEPPING
        self._initialised = True
        self._quickly_settable = self._inputs

    @guarded
    def do_step(self, current_time: float, step_size: float) -> bool:
        """fmi2DoStep."""
        self._expect(Phase.STEPPING, "fmi2DoStep")
        self._expect_in_time(current_time, step_size)
        self._advance(current_time, step_size)
        self._reached = current_time + step_size
        return True

    def _advance(self, current_time: float, step_size: float) -> None:
        """A step, its time already checked; the entry point of what is compiled to C."""
        if not (step_size > 0.0 and math.isfinite(current_time + step_size)):
            require(math.isfinite(current_time), "currentCommunicationPoint", current_time, "a finite time")
            require(False, "communicationStepSize", step_size, "a positive number of seconds")
        if self._stale:
            self._take_parameters()
        try:
            self.step(current_time, step_size)
        except (ArithmeticError, ValueError) as error:  # a float left its range in a computation
            raise DivergenceError(f"at t = {current_time}: {error}, expected finite values") from error

    def _derive(self, t: float, since: float) -> tuple[float, ...]:
        """The numbers of all derivatives, and the next jump; an entry point of what is compiled to C."""
        if self._stale:
            self._take_parameters()
        try:
            found = self.derivatives(t, since)
        except (ArithmeticError, ValueError) as error:
            raise DivergenceError(f"at t = {t}: {error}, expected finite values") from error
        frames = {each.attribute: each.frame for each in self._declared if each.frame is not None}
        rates = [
            frames[name](self.is_turned, rate) if name in frames else rate
            for name, rate in zip(self.continuous_states, found, strict=True)
        ]
        numbers = [part for rate in rates for part in (rate if hasattr(rate, "__iter__") else (rate,))]
        return (*numbers, self.next_jump())

    @guarded
    def terminate(self) -> None:
        """fmi2Terminate."""
        self._expect(Phase.STEPPING, "fmi2Terminate")
        self._phase = Phase.TERMINATED

    @guarded
    def get_real(self, vrs: list[int]) -> list[float]:
        """fmi2GetReal; in initialisation mode, values that were set can be read back before the others are set."""
        self._bring_up_to_date(vrs)
        if not self._readable.issuperset(vrs):
            raise self._wrong_type(vrs, "Real")
        reals = self._reals
        return [reals[vr] for vr in vrs]

    @guarded
    def set_real(self, vrs: list[int], values: list[float]) -> None:
        """fmi2SetReal."""
        if self._quickly_settable.issuperset(vrs) and math.isfinite(sum(values)):
            reals = self._reals
            for vr, value in zip(vrs, values):
                reals[vr] = value
            return
        for vr, value in zip(vrs, values):
            variable = self._settable(vr, "Real")
            require(math.isfinite(value), variable.name, value, "a finite value")
            self._reals[vr] = value

    @guarded
    def get_integer(self, vrs: list[int]) -> list[int]:
        """fmi2GetInteger; also for Enumerations."""
        self._bring_up_to_date(vrs)
        return [int(self._others[vr]) for vr in self._of_type(vrs, "Integer", "Enumeration")]

    @guarded
    def set_integer(self, vrs: list[int], values: list[int]) -> None:
        """fmi2SetInteger; also for Enumerations."""
        self._set_others(vrs, values, "Integer", "Enumeration")

    @guarded
    def get_boolean(self, vrs: list[int]) -> list[bool]:
        """fmi2GetBoolean."""
        self._bring_up_to_date(vrs)
        return [bool(self._others[vr]) for vr in self._of_type(vrs, "Boolean")]

    @guarded
    def set_boolean(self, vrs: list[int], values: list[bool]) -> None:
        """fmi2SetBoolean."""
        self._set_others(vrs, values, "Boolean")

    @guarded
    def get_string(self, vrs: list[int]) -> list[str]:
        """fmi2GetString; there are no String variables, but some masters call it with none."""
        self._of_type(vrs, "String")
        return []

    @guarded
    def set_string(self, vrs: list[int], values: list[str]) -> None:
        """fmi2SetString; as `get_string`."""
        self._of_type(vrs, "String")

    @guarded
    def _get_fmu_state(self) -> State:
        return {
            "model": type(self).__name__,
            "reals": list(self._reals),
            "others": [[vr, value] for vr, value in self._others.items()],
            "phase": int(self._phase),
            "start_time": self._start_time,
            "stop_time": self._stop_time,
            "reached": self._reached,
            "stale": self._stale,
            "warned": list(self._warned),
            "internal": self.internal_state() if self._initialised else None,
        }

    @guarded
    def _set_fmu_state(self, state: State) -> None:
        expect_state(state, type(self).__name__, self.variables)
        self._reals[:] = state["reals"]
        self._others.update(state["others"])
        self._phase = Phase(state["phase"])
        self._start_time, self._stop_time = state["start_time"], state["stop_time"]
        self._reached = state["reached"]
        self._stale = state["stale"]
        self._warned = list(state["warned"])
        self._quickly_settable = self._inputs if self._phase is Phase.STEPPING else frozenset()
        self._initialised = state["internal"] is not None
        if self._initialised:
            if not self._stale:  # else the next step checks them
                self._check_parameters()
            self.read_parameters()
            try:
                self.restore(state["internal"])
            except (LookupError, TypeError, ValueError) as error:
                raise FmuError(f"FMU state (internal) = {state['internal']}: expected what the model saves") from error

    @staticmethod
    def _fmu_state_to_bytes(state: State) -> bytes:
        return serialise(state)

    @staticmethod
    def _fmu_state_from_bytes(content: bytes) -> State:
        """Never raises, since pythonfmu could not free the class then; `_set_fmu_state` refuses what is not a state."""
        return deserialise(content)

    def to_xml(self, model_options: dict[str, str] | None = None) -> Element:
        """The model description; called when the FMU is built."""
        return write_description.to_xml(type(self))

    # -- internals ------------------------------------------------------------------------------------------

    def _initialise(self) -> None:
        self._take_parameters()
        for name, start in self._initial.items():
            self._reals[self._index[name]] = self._reals[self._index[start]]
        try:
            self.initialise(self._start_time)
        except (ArithmeticError, ValueError) as error:
            raise DivergenceError(f"at initialisation: {error}, expected finite values") from error

    def _bring_up_to_date(self, vrs: list[int]) -> None:
        """In initialisation mode, recompute the values to be read if others were set since they were computed."""
        if self._stale and self._phase is Phase.INITIALIZATION and not self._with_start.issuperset(vrs):
            self._initialise()

    def _take_parameters(self) -> None:
        self._check_parameters()
        for place, index in self._indices.items():
            number = self._others[index]
            self._others[place] = FLOAT.where(number > 0, number, self._others[place])
        self.read_parameters()
        self._stale = False

    def _check_parameters(self) -> None:
        for i, variable in enumerate(self.variables):
            if variable.causality == "parameter" and variable.type != "Boolean":
                variable.check(self._reals[i] if i < self._real_count else self._others[i])

    def _expect(self, phase: Phase, call: str) -> None:
        if self._phase is not phase:
            raise FmuError(f"{call} in phase {self._phase.name.lower()}: expected phase {phase.name.lower()}")

    def _expect_in_time(self, t: float, h: float) -> None:
        """Raise `FmuError` for a step that does not begin where the last one ended, or that ends past the stop time.

        Times that are not finite are not checked here.
        """
        slack = TIME_TOLERANCE * max(1.0, abs(t), h)
        if self._reached is not None and abs(t - self._reached) > slack:
            raise FmuError(f"currentCommunicationPoint = {t}: expected {self._reached}, where the last step ended")
        if t + h - self._stop_time > slack:
            raise FmuError(f"communicationStepSize = {h} from {t}: expected no step past stopTime = {self._stop_time}")

    def _settable(self, vr: int, *types: str) -> Variable:
        """The variable of `vr`; raises `FmuError` if it is not of one of the types, or must not be set now."""
        self._of_type([vr], *types)
        variable = self.variables[vr]
        if variable.variability == "constant":
            raise FmuError(f"{variable.name}: a constant, fixed when the FMU was built, cannot be set")
        if not variable.is_settable:
            raise FmuError(f"{variable.name}: a variable with causality {variable.causality} cannot be set")
        if self._phase >= Phase.STEPPING and vr not in self._inputs and vr not in self._tunable:
            raise FmuError(f"{variable.name}: a fixed parameter cannot be set after initialisation")
        if vr not in self._inputs or self._phase is not Phase.STEPPING:
            self._stale = True
        return variable

    def _set_others(self, vrs: list[int], values: Iterable[int | bool], *types: str) -> None:
        for vr, value in zip(vrs, values):
            self._settable(vr, *types)
            self._others[vr] = value

    def _of_type(self, vrs: list[int], *types: str) -> list[int]:
        if any(not 0 <= vr < len(self.variables) or self.variables[vr].type not in types for vr in vrs):
            raise self._wrong_type(vrs, *types)
        return vrs

    def _wrong_type(self, vrs: list[int], *types: str) -> FmuError:
        known = [i for i, v in enumerate(self.variables) if v.type in types]
        expected = f"{known[0]} to {known[-1]}" if known else "none, this FMU has no such variables"
        bad = [vr % 2**32 for vr in vrs if vr not in known]  # the native part passes them as signed numbers
        return FmuError(f"value reference {bad}: expected one of a {types[0]} variable ({expected})")

    def _failure_of(self, error: Exception) -> Failure:
        failure = report(self, error, again=self._has_failed)
        self._has_failed = True
        self._phase = Phase.FAILED
        self._quickly_settable = frozenset()
        return failure


def _first_line(text: str) -> str:
    """The first paragraph of a docstring, in one line without its full stop."""
    return " ".join(text.strip().partition("\n\n")[0].split()).removesuffix(".")
