"""C that calls a user's own C: reads and sets its variables, which are named as lvalues, and runs its statements.

The compiler knows the types of the lvalues, so no header is parsed. Its errors name the line of the user's file.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from fmu_kit.compiler.emit.c_names import c_string
from fmu_kit.compiler.runtime import FOLDER
from fmu_kit.variables import Causality, Variable

CXX = (".cpp", ".cc", ".cxx")
"""Endings of sources in C++"""


@dataclass(frozen=True, kw_only=True)
class Code:
    """C that a user wrote, and its line in the user's file."""

    text: str
    line: int


@dataclass(frozen=True, kw_only=True)
class Place:
    """A variable of an FMU: the lvalue that has it in the user's code."""

    name: str
    causality: Causality
    lvalue: Code
    unit: str | None = None
    description: str = ""
    minimum: float | None = None
    maximum: float | None = None

    def variable(self, start: float) -> Variable:
        """The FMI variable."""
        return Variable(
            name=self.name,
            description=self.description,
            causality=self.causality,
            variability="fixed" if self.causality == "parameter" else "discrete",
            unit=self.unit,
            start=start,
            minimum=self.minimum,
            maximum=self.maximum,
        )


@dataclass(frozen=True, kw_only=True)
class Task:
    """Statements that run at each step, or at each `ratio`-th, beginning with the first."""

    step: Code
    ratio: int = 1
    name: str = ""
    """Its name, as that of a partition of FMI 3.0; empty: it is none"""
    period: float = 0.0
    """The period that it believes [s]"""


@dataclass(frozen=True, kw_only=True)
class UserCode:
    """What a user's file says of the code to wrap."""

    name: str
    file: str
    """name of the user's file, for errors"""
    hash: str
    """hash of its content"""
    folder: str
    """folder of it, to which paths are relative"""
    period: float
    """the sampling period that the code believes [s]"""
    description: str
    author: str
    license: str
    sources: tuple[str, ...]
    include: tuple[str, ...]
    defines: tuple[str, ...]
    sanitize: bool
    """whether what C leaves undefined traps"""
    in_double: bool = False
    """whether its floats are doubles"""
    headers: tuple[Code, ...]
    declare: Code | None
    init: Code | None
    after_parameters: Code | None
    tasks: tuple[Task, ...]
    places: tuple[Place, ...]
    """inputs, outputs, parameters, in this order"""

    @property
    def is_cxx(self) -> bool:
        """Whether the statements are C++: some source is."""
        return any(source.endswith(CXX) for source in self.sources)

    @property
    def partitions(self) -> tuple[Task, ...]:
        """The tasks that have a name, which FMI 3.0 can run one by one."""
        return tuple(task for task in self.tasks if task.name)

    def having(self, causality: Causality) -> tuple[Place, ...]:
        """The places of a causality."""
        return tuple(place for place in self.places if place.causality == causality)


# Names of the user's own variables must not be hidden by those of the functions here.
_CXX = (FOLDER / "user_code.h").read_text(encoding="utf-8")


def user_code(code: UserCode) -> str:
    """The C or C++ beside the sources of a user."""
    lines = [line for header in code.headers for line in _at(code, header, f'#include "{header.text}"')]
    if code.declare is not None:
        lines += _at(code, code.declare)
    lines += [*([_CXX] if code.is_cxx else []), '#line 1 "user_code"']
    lines += _function(code, "quadcosim_init", code.init)
    lines += _function(code, "quadcosim_after_parameters", code.after_parameters)
    lines += _step(code)
    lines += _set(code, "set_inputs", "input")
    lines += _set(code, "set_parameters", "parameter")
    lines += _get(code, "get_outputs", code.having("output"))
    lines += _get(code, "get_all", code.places)
    return "\n".join([*lines, ""])


def places(code: UserCode, starts: Sequence[float], state_bytes: int) -> str:
    """places.h: the memory of an instance, and the parameters' bounds."""
    parameters = [place.variable(0.0) for place in code.having("parameter")]
    parts = [
        "/* The memory: the variables by value reference, then what is kept, at last the state of the code. */",
        f"enum {{ FIRST_OUTPUT = {len(code.having('input'))}, "
        f"FIRST_PARAMETER = {len(code.places) - len(parameters)}, VARIABLES = {len(code.places)} }};",
        "enum { KEPT_START_TIME = VARIABLES, KEPT_STALE, KEPT_STATE };",
        f"#define STATE_BYTES {state_bytes}",
        *_partitions(code.partitions),
        "enum { PLACES = KEPT_STATE + (STATE_BYTES + 7) / 8 };",
        f"static const double starts[PLACES] = {{{', '.join(map(repr, (*starts, 0.0, 1.0)))}}};",
        _array("double lowest[]", (_number(v.minimum, "-") for v in parameters)),
        _array("double highest[]", (_number(v.maximum, "") for v in parameters)),
        "enum { OUT_OF_BOUNDS = 1, DIVERGENCE = 2 }; /* errors of instances and lanes */",
    ]
    return "\n".join(parts) + "\n"


def _partitions(tasks: Sequence[Task]) -> Iterator[str]:
    """The number of partitions, and the periods [s] that they believe."""
    if tasks:
        yield f"#define PARTITIONS {len(tasks)}"
        yield f"static const double partition_intervals[] = {{{', '.join(repr(task.period) for task in tasks)}}};"


def texts(code: UserCode) -> str:
    """The names of variables and the bounds of parameters, for messages."""
    return "\n".join([
        _array("char *const names[]", (c_string(place.name) for place in code.places)),
        _array("char *const bounds[]", (c_string(p.variable(0.0).bounds) for p in code.having("parameter"))),
    ]) + "\n"  # fmt: skip


def _array(declaration: str, values: Iterator[str]) -> str:
    """Values, of which there may be none."""
    return f"static const {declaration} = {{{', '.join([*values, '0'])}}};"


def _number(bound: float | None, sign: str) -> str:
    return f"{sign}1e999" if bound is None else repr(bound)


def _step(code: UserCode) -> list[str]:
    """The statements of each task, and the functions that run one of them, or those that are due at a step."""
    lines = []
    for number, task in enumerate(code.tasks):
        lines += [f"static void quadcosim_task_{number}(void) {{", *_at(code, task.step), "}"]
    numbers = range(len(code.tasks))
    one = [f"if (quadcosim_task == {number}) quadcosim_task_{number}();" for number in numbers]
    lines += ["void quadcosim_run(unsigned quadcosim_task) {", *one, "}"]
    if all(task.ratio == 1 for task in code.tasks):
        return [*lines, "void quadcosim_step(void) {", *(f"quadcosim_task_{number}();" for number in numbers), "}"]
    lines += ["static unsigned long long quadcosim_ticks;", "void quadcosim_step(void) {"]
    lines += ["const unsigned long long quadcosim_tick = quadcosim_ticks++;"]
    for number, task in enumerate(code.tasks):
        lines.append(f"if (quadcosim_tick % {task.ratio}u == 0) quadcosim_task_{number}();")
    return [*lines, "}"]


def _function(code: UserCode, name: str, body: Code | None) -> list[str]:
    return [f"void {name}(void) {{", *([] if body is None else _at(code, body)), "}"]


_NUMBERS = sum(1 << kind for kind in (1, 2, 3, 4, 8))
"""Arithmetic types by their number in `__builtin_classify_type`, which knows bit fields, too"""
_IS_NUMBER = f"_Static_assert({_NUMBERS} >> __builtin_classify_type({{lvalue}}) & 1, {{told}});"
_IS_NUMBER_CXX = "static_assert(quadcosim_one<decltype({lvalue})>::is, {told});"
# No macros, in whose place an error would have no line of the user's.
_TO_C = (
    "{{ const double quadcosim_x = {value}; "
    "if (__builtin_classify_type({lvalue}) == 8) {lvalue} = quadcosim_x; "
    # Integers are rounded, also those in bit fields, of which only the compiler knows that they are some.
    "else {{ if (quadcosim_x > -9e18 && quadcosim_x < 9e18) "
    "{lvalue} = (long long)(quadcosim_x < 0.0 ? quadcosim_x - 0.5 : quadcosim_x + 0.5); "
    "const double quadcosim_off = (double)({lvalue}) - quadcosim_x; "
    "if (!(quadcosim_off >= -0.5 && quadcosim_off <= 0.5)) return {number}; }} }}"
)
_TO_CXX = (
    "{{ const double quadcosim_x = {value}; typedef quadcosim_kind<decltype({lvalue})> quadcosim_type; "
    "({lvalue}) = quadcosim_type::of(quadcosim_x); "
    "if (!quadcosim_type::has(quadcosim_x, (double)({lvalue}))) return {number}; }}"
)


def _set(code: UserCode, name: str, causality: Causality) -> Iterator[str]:
    """A function that passes variables to the code, up to the first that its type in C does not hold, if any.

    It returns the number of that variable among them, or how many they are.
    """
    of_causality = code.having(causality)
    form = _TO_CXX if code.is_cxx else _TO_C
    yield from _each(
        code, f"unsigned quadcosim_{name}(const double", of_causality, form, f"return {len(of_causality)};"
    )


def _get(code: UserCode, name: str, places: Sequence[Place]) -> Iterator[str]:
    """A function that passes variables from the code."""
    yield from _each(code, f"void quadcosim_{name}(double", places, "{value} = (double)({lvalue});")


def _each(code: UserCode, head: str, places: Sequence[Place], form: str, last: str = "") -> Iterator[str]:
    yield f"{head} *quadcosim_values, unsigned quadcosim_apart) {{"
    yield "(void)quadcosim_values; (void)quadcosim_apart;"
    for number, place in enumerate(places):
        value = f"quadcosim_values[{number} * quadcosim_apart]"
        check = (_IS_NUMBER_CXX if code.is_cxx else _IS_NUMBER).format(lvalue=place.lvalue.text, told=_refusal(place))
        passing = form.format(value=value, lvalue=place.lvalue.text, number=number)
        yield from _at(code, place.lvalue, check + passing)
    yield last + "}"


def _refusal(place: Place) -> str:
    """What is wrong with an lvalue that is no number, as a literal of C."""
    text = place.lvalue.text
    return c_string(
        f"{place.causality}s.{place.name} = {text} is an array, a pointer or a struct: expected one number, as "
        f"{text}[0] or a field, and a name for each"
    )


def _at(code: UserCode, part: Code, text: str | None = None) -> list[str]:
    """A part of the user's file, of which the compiler's errors name the line."""
    return [f"#line {part.line} {c_string(code.file)}", part.text if text is None else text, '#line 1 "user_code"']
