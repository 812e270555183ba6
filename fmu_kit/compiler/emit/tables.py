"""What a slave says of its variables, as tables in C: starts, types, and what it answers where it refuses.

The answers are those of the slave itself: it is asked in Python, and what it says is written down.
"""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable, Iterable, Iterator, Sequence

from fmu_kit.compiler.emit.c_code import ERRORS, c_string, place_names
from fmu_kit.compiler.emit.standards import Standard
from fmu_kit.compiler.trace.memory import Memory, name_of_kept
from fmu_kit.compiler.trace.statements import Place
from fmu_kit.compiler.trace.symbols import TraceError
from fmu_kit.compiler.trace.tracing import Program
from fmu_kit.compiler.trace.tree import is_number, leaves
from fmu_kit.errors import FmuError
from fmu_kit.saved_state import DAMAGED, expect_state
from fmu_kit.slave import TIME_TOLERANCE, Phase, Slave

_UNUSED = 4_242_424_242
"""A value reference that no variable has."""
_CALLS = {
    "SETUP_EXPERIMENT": Phase.INSTANTIATED,
    "ENTER_INITIALIZATION_MODE": Phase.INSTANTIATED,
    "EXIT_INITIALIZATION_MODE": Phase.INITIALIZATION,
    "DO_STEP": Phase.STEPPING,
    "TERMINATE": Phase.STEPPING,
}
"""The phase that each call is for."""
_SET_REAL, _SET_START = inspect.unwrap(Slave.set_real), inspect.unwrap(Slave.setup_experiment)


def tables(program: Program, guid: str, standard: Standard) -> str:
    """The tables of a program, for the FMU of this GUID; calls and types are named as the version of FMI does."""
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
        f"enum {{ REALS = {sum(v.type == 'Real' for v in variables)} }};",
        "typedef enum { REAL, INTEGER, BOOLEAN, STRING, ENUMERATION } Type;",
        "/* By whose functions they are got and set. */",
        _array("Type types[VARIABLES]", (alike[v.type][0].upper() for v in variables)),
        "enum { GIVEN = 1, INPUT = 2 }; /* from outside; while the FMU is stepped as well */",
        _array("unsigned char kinds[VARIABLES]", map(str, inputs)),
        _listed("typedef enum", _CALLS) + " Call;",
        "/* What is answered in each phase; NULL: nothing, the call is carried out. */",
        _array(
            f"Text refused_call[{len(_CALLS)}][PHASES]",
            (_refused(slave, slave._expect, phase, standard.calls[call]) for call, phase in _CALLS.items()),
        ),
        _array(
            "Text refused_setting[VARIABLES][PHASES]",
            (_refused(slave, slave._settable, i, v.type) for i, v in enumerate(variables)),
        ),
        "/* The text before a value that cannot be, and after it. */",
        _array("Text bad_value[VARIABLES][2]", (_refused_value(slave, i) for i in range(len(variables)))),
        "/* The text before the model and the number of Reals of another state, and after them. */",
        "static const Text foreign_state[2] = "
        f"{_around(['None, 0'], slave, expect_state, {}, program.model, variables)};",
        f"static const Text damaged_state = {c_string(_damaged(slave))};",
        "/* The texts around what is wrong with a time. */",
        f"#define TIME_TOLERANCE {TIME_TOLERANCE!r}",
        *_of_times(program.slave(instance_name="times")),
        _array("Text wrong_type[5][2]", (_wrong_type(slave, alike[type], standard.types[type]) for type in alike)),
    ]
    return "\n".join(parts) + "\n"


def places(program: Program) -> str:
    """The memory of a program: the name of each place, and what it holds at first."""
    slave = program.slave(instance_name="places")
    names = place_names(program.places)
    parts = [
        "/* The memory: the variables by value reference, then what the model keeps. */",
        f"enum {{ VARIABLES = {len(program.slave.variables)} }};",
        _listed("enum", [*(names[place.name] for place in program.places), "PLACES"]) + ";",
        _array("double starts[PLACES]", (repr(start_of(slave, place)) for place in program.places)),
        f"enum {{ DIVERGENCE = {1 + ERRORS.index('DivergenceError')} }}; /* what a function returns in that case */",
    ]
    return "\n".join(parts) + "\n"


def start_of(slave: Slave, place: Place) -> float:
    """What a place holds before initialisation; what the slave does not have then is not read before it is written."""
    if place.reference is not None:
        return float(slave.variables[place.reference].start)
    kept = {name_of_kept(path): value for path, value in leaves(Memory(slave, {}).attributes()) if is_number(value)}
    return float(kept.get(place.name, 0.0))


def _listed(head: str, items: Iterable[str]) -> str:
    body = ",\n".join(f"    {item}" for item in items)
    return f"{head} {{\n{body}\n}}"


def _array(declaration: str, values: Iterable[str]) -> str:
    return _listed(f"static const {declaration} =", values) + ";"


def _row(texts: Iterable[str | None]) -> str:
    return "{" + ", ".join("NULL" if text is None else c_string(text) for text in texts) + "}"


def _refused(slave: Slave, call: Callable[..., object], *given: object) -> str:
    """What the slave answers to a call in each phase."""
    return _row(_answer(slave, phase, call, *given) for phase in Phase)


def _of_times(slave: Slave) -> Iterator[str]:
    """What it answers to times that cannot be; asked with times that can be told apart in its texts."""
    slave._reached, slave._stop_time = 2.5, 4.5
    asked = {
        "bad_start_time": _around(["nan"], slave, _SET_START, slave, math.nan),
        "bad_stop_time": _around(["0.5", "1.5"], slave, _SET_START, slave, 1.5, 0.5),
        "bad_time": _around(["3.5", "2.5"], slave, slave._expect_in_time, 3.5, 0.25),
        "bad_end": _around(["2.25", "2.5", "4.5"], slave, slave._expect_in_time, 2.5, 2.25),
    }
    for name, around in asked.items():
        yield f"static const Text {name}[] = {around};"


def _damaged(slave: Slave) -> str:
    """What it answers to a state whose bytes are not those that were serialised."""
    state = {**slave._get_fmu_state(), DAMAGED: True}
    return _answer(slave, Phase.INSTANTIATED, expect_state, state, type(slave).__name__, slave.variables) or ""


def _refused_value(slave: Slave, reference: int) -> str:
    """What it answers to a value that is not finite: before the value, and after it."""
    variable = slave.variables[reference]
    if variable.type != "Real" or not variable.is_settable:
        return _row(("", ""))
    return _around(["nan"], slave, _SET_REAL, slave, [reference], [math.nan])


def _wrong_type(slave: Slave, types: list[str], called: str) -> str:
    """What it answers to a value reference that no variable of some types has: before the reference, and after it."""
    return _around([f"{_UNUSED}"], slave, slave._of_type, [_UNUSED], *types).replace(f" {types[0]} ", f" {called} ")


def _around(values: Sequence[str], slave: Slave, call: Callable[..., object], *given: object) -> str:
    """What the slave answers to values that it names in this order: before, between and after them."""
    text = rest = _answer(slave, Phase.INSTANTIATED, call, *given) or ""
    parts = []
    for value in values:
        before, found, rest = rest.partition(value)
        if not found:
            raise TraceError(f"{text!r}: expected a refusal that names {', '.join(values)}")
        parts.append(before)
    return _row((*parts, rest))


def _answer(slave: Slave, phase: Phase, call: Callable[..., object], *given: object) -> str | None:
    """What the slave answers to a call in a phase, if it refuses it."""
    slave._phase = phase
    try:
        call(*given)
    except FmuError as error:
        return str(error)
    finally:
        slave._phase = Phase.INSTANTIATED
    return None
