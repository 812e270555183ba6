"""Tables in C of a slave's variables: start values, types, and the texts with which it refuses calls.

The texts are those of the slave in Python: each invalid call is made there, and its error is recorded.
"""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable, Iterable, Iterator, Sequence

from fmu_kit.compiler.emit.c_code import ERRORS
from fmu_kit.compiler.emit.c_names import c_string, place_names
from fmu_kit.compiler.emit.exchange import continuous_states
from fmu_kit.compiler.emit.standards import Standard, sampling_period
from fmu_kit.compiler.trace.errors import TraceError
from fmu_kit.compiler.trace.memory import Memory, attribute_name
from fmu_kit.compiler.trace.statements import Place
from fmu_kit.compiler.trace.tracing import Program
from fmu_kit.compiler.trace.tree import is_number, leaves
from fmu_kit.errors import FmuError
from fmu_kit.saved_state import DAMAGED, expect_state
from fmu_kit.slave import TIME_TOLERANCE, Phase, Slave

_UNUSED = 4_242_424_242
"""A value reference of no variable."""
_CALLS = {
    "SETUP_EXPERIMENT": Phase.INSTANTIATED,
    "ENTER_INITIALIZATION_MODE": Phase.INSTANTIATED,
    "EXIT_INITIALIZATION_MODE": Phase.INITIALIZATION,
    "DO_STEP": Phase.STEPPING,
    "TERMINATE": Phase.STEPPING,
}
"""The phase in which each call is allowed."""
_SET_REAL, _SET_START = inspect.unwrap(Slave.set_real), inspect.unwrap(Slave.setup_experiment)


def tables(program: Program, guid: str, standard: Standard) -> str:
    """The tables of a program, for an FMU with this GUID; calls and types have the names of the version of FMI."""
    slave = program.slave(instance_name="tables")
    variables = program.slave.variables
    inputs = [(1 if v.has_start else 0) + (2 if v.causality == "input" else 0) for v in variables]
    alike = {
        type: [other for other, its_name in standard.types.items() if its_name == name]
        for type, name in standard.types.items()
    }
    parts = [
        f"#define GUID {c_string(guid)}",
        f"#define MODEL {c_string(program.model)}",
        *(_clock(program.slave) if standard.has_clocks else ()),
        *_states(program),
        f"enum {{ REALS = {sum(v.type == 'Real' for v in variables)} }};",
        "typedef enum { REAL, INTEGER, BOOLEAN, STRING, ENUMERATION } Type;",
        "/* The type whose functions get and set each variable. */",
        _array("Type types[VARIABLES]", (alike[v.type][0].upper() for v in variables)),
        "enum { GIVEN = 1, INPUT = 2 }; /* set from outside; also between steps */",
        _array("unsigned char kinds[VARIABLES]", map(str, inputs)),
        _listed("typedef enum", _CALLS) + " Call;",
        "/* The error of a call in each phase; NULL: the call is allowed. */",
        _array(
            f"Text refused_call[{len(_CALLS)}][PHASES]",
            (_errors_by_phase(slave, slave._expect, phase, standard.calls[call]) for call, phase in _CALLS.items()),
        ),
        _array(
            "Text refused_setting[VARIABLES][PHASES]",
            (_errors_by_phase(slave, slave._settable, i, v.type) for i, v in enumerate(variables)),
        ),
        "/* The texts before and after an invalid value. */",
        _array("Text bad_value[VARIABLES][2]", (_refused_value(slave, i) for i in range(len(variables)))),
        "/* The texts before and after the model and the number of Reals of a foreign state. */",
        "static const Text foreign_state[2] = "
        f"{_around(['None, 0'], slave, expect_state, {}, program.model, variables)};",
        f"static const Text damaged_state = {c_string(_damaged_state_error(slave))};",
        "/* The texts around invalid times. */",
        f"#define TIME_TOLERANCE {TIME_TOLERANCE!r}",
        *_time_errors(program.slave(instance_name="times")),
        _array("Text wrong_type[5][2]", (_wrong_type(slave, alike[type], standard.types[type]) for type in alike)),
    ]
    return "\n".join(parts) + "\n"


def _clock(slave: type[Slave]) -> Iterator[str]:
    """The clock of a slave that samples: the place of its period, and the interval [s] unless a host sets it."""
    period = sampling_period(slave)
    if period is not None:
        yield f"enum {{ SAMPLE_PERIOD = {period} }};"
        yield f"#define CLOCK_INTERVAL {slave.default_experiment.step_size!r}"


def _states(program: Program) -> Iterator[str]:
    """The continuous states, for model exchange; no array is empty."""
    states = continuous_states(program)
    kept = [str(state.place) for state in states if state.is_kept]
    yield f"enum {{ KEPT_STATES = {len(kept)} }}; /* those that are no variables */"
    yield f"#define STATES {len(states)} /* continuous states */"
    yield f"enum {{ RATES = {program.of_derivatives[-1].results if states else 0} }}; /* results of model_derive */"
    listed = {
        "unsigned state_places": [str(state.place) for state in states],
        "unsigned kept_places": kept,
        "unsigned state_rates": [str(state.rate) for state in states],
        "double nominals": [repr(state.variable.nominal or 1.0) for state in states],
    }
    for name, values in listed.items():
        yield _array(f"{name}[{len(values) + 1}]", [*values, "0"])


def places(program: Program) -> str:
    """The memory of a program: the name of each place, and its start value."""
    slave = program.slave(instance_name="places")
    names = place_names(program.places)
    parts = [
        "/* The memory: the variables by value reference, then the other numbers of the model. */",
        f"enum {{ VARIABLES = {len(program.slave.variables)} }};",
        _listed("enum", [*(names[place.name] for place in program.places), "PLACES"]) + ";",
        _array("double starts[PLACES]", (repr(start_of(slave, place)) for place in program.places)),
        f"enum {{ DIVERGENCE = {1 + ERRORS.index('DivergenceError')} }}; /* status of that error */",
    ]
    return "\n".join(parts) + "\n"


def start_of(slave: Slave, place: Place) -> float:
    """The value of a place before initialisation; places that do not exist then are written before they are read."""
    if place.reference is not None:
        return float(slave.variables[place.reference].start)
    kept = {attribute_name(path): value for path, value in leaves(Memory(slave, {}).attributes()) if is_number(value)}
    return float(kept.get(place.name, 0.0))


def _listed(head: str, items: Iterable[str]) -> str:
    body = ",\n".join(f"    {item}" for item in items)
    return f"{head} {{\n{body}\n}}"


def _array(declaration: str, values: Iterable[str]) -> str:
    return _listed(f"static const {declaration} =", values) + ";"


def _row(texts: Iterable[str | None]) -> str:
    return "{" + ", ".join("NULL" if text is None else c_string(text) for text in texts) + "}"


def _errors_by_phase(slave: Slave, call: Callable[..., object], *given: object) -> str:
    """The errors of a call in each phase."""
    return _row(_error_of(slave, phase, call, *given) for phase in Phase)


def _time_errors(slave: Slave) -> Iterator[str]:
    """The errors for invalid times; each call has times that differ, so that they can be found in its text."""
    slave._reached, slave._stop_time = 2.5, 4.5
    errors = {
        "bad_start_time": _around(["nan"], slave, _SET_START, slave, math.nan),
        "bad_stop_time": _around(["0.5", "1.5"], slave, _SET_START, slave, 1.5, 0.5),
        "bad_time": _around(["3.5", "2.5"], slave, slave._expect_in_time, 3.5, 0.25),
        "bad_end": _around(["2.25", "2.5", "4.5"], slave, slave._expect_in_time, 2.5, 2.25),
    }
    for name, texts in errors.items():
        yield f"static const Text {name}[] = {texts};"


def _damaged_state_error(slave: Slave) -> str:
    """The error for a state whose bytes were changed after it was serialised."""
    state = {**slave._get_fmu_state(), DAMAGED: True}
    return _error_of(slave, Phase.INSTANTIATED, expect_state, state, type(slave).__name__, slave.variables) or ""


def _refused_value(slave: Slave, reference: int) -> str:
    """The texts before and after a value that is not finite."""
    variable = slave.variables[reference]
    if variable.type != "Real" or not variable.is_settable:
        return _row(("", ""))
    return _around(["nan"], slave, _SET_REAL, slave, [reference], [math.nan])


def _wrong_type(slave: Slave, types: list[str], called: str) -> str:
    """The texts before and after a value reference of no variable of some types."""
    return _around([f"{_UNUSED}"], slave, slave._of_type, [_UNUSED], *types).replace(f" {types[0]} ", f" {called} ")


def _around(values: Sequence[str], slave: Slave, call: Callable[..., object], *given: object) -> str:
    """The texts before, between and after the values in the error of a call, which names them in this order."""
    text = rest = _error_of(slave, Phase.INSTANTIATED, call, *given) or ""
    parts = []
    for value in values:
        before, found, rest = rest.partition(value)
        if not found:
            raise TraceError(f"{text!r}: expected a refusal that names {', '.join(values)}")
        parts.append(before)
    return _row((*parts, rest))


def _error_of(slave: Slave, phase: Phase, call: Callable[..., object], *given: object) -> str | None:
    """The error of a call in a phase, or None if it is allowed."""
    slave._phase = phase
    try:
        call(*given)
    except FmuError as error:
        return str(error)
    finally:
        slave._phase = Phase.INSTANTIATED
    return None
