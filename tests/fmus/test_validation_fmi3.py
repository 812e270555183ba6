"""Validation of FMUs of FMI 3.0: those that are sound, and rules that FMI 2.0 has not."""

from pathlib import Path
from xml.etree.ElementTree import fromstring

import pytest

from orchestration.components.building import fmus
from orchestration.components.checks.validation.description import capabilities
from orchestration.components.checks.validation.finding import Finding, Rule
from orchestration.components.checks.validation.fmu import Fmu
from orchestration.components.checks.validation.structure import RULES, indices, known_dependencies
from orchestration.components.checks.validation.validator import validate
from orchestration.components.checks.validation.variables import arrays, bounds, names
from orchestration.components.fmi.archive import UnreadableFmuError
from orchestration.components.fmi.instance import start_value
from orchestration.components.fmi.read_description import scalars_of
from tests.fmus.archive import files_of, view_of
from tests.fmus.damage import DESCRIPTION, write_fmu
from tests.fmus.making import PAIR
from tests.orchestration.components.fmi.small import CLOCK, needs_compiler, small

# -- FMUs that run --------------------------------------------------------------------------------------


@pytest.mark.parametrize("model", PAIR)
def test_nothing_is_wrong_with_those_of_this_project(model: str) -> None:
    assert validate(fmus.locate(f"native/fmi3/{model}")) == []


SMALL = Path(__file__).with_name("test_validation_fmi3.xml").read_text(encoding="utf-8")


def foreign(folder: Path, *habits: str, old: str = "", new: str = "") -> Path:
    """An FMU in C with arrays and types of FMI 3.0, as other tools make them, a text of its description replaced."""
    assert old in SMALL
    path = small(folder, "HEEDS_STOP", *habits, fmi=3)
    write_fmu(path, {**files_of(path), DESCRIPTION: SMALL.replace(old, new, 1).encode()})
    return path


@needs_compiler
@pytest.mark.parametrize(
    ("habit", "found"),
    [
        ("SOUND", []),
        ("STATICS", [("repeatable", True)]),  # each instance starts elsewhere, which breaks no rule
        ("ENDS_AT=0.055", []),  # it may end the run
        ("BROKEN_RESET", [("reset", False)]),
        ("FIXED_STEP", [("variable-steps", False)]),
        ("NEEDS_EVENTS", [("runs", False)]),
    ],
)
def test_only_what_breaks_the_standard_is_a_problem(habit: str, found: list[tuple[str, bool]], tmp_path: Path) -> None:
    assert [(finding.rule, finding.note) for finding in validate(foreign(tmp_path, habit))] == found


@needs_compiler
@pytest.mark.parametrize(
    ("habit", "text"),
    [
        ("NEEDS_EVENTS", "fmi3DoStep: eventHandlingNeeded = true from 0.0 to 0.01: expected false, it was not offered"),
        ("RETURNS_EARLY", "fmi3DoStep: earlyReturn = true from 0.0 to 0.01: expected false, it was not offered"),
        ("LOSES_TIME", "fmi3DoStep: lastSuccessfulTime = nan from 0.0 to 0.01: expected a time"),
        ("REFUSES", "fmi3DoStep: level is too high"),
    ],
)
def test_what_a_step_answers_is_held_to_what_was_offered(habit: str, text: str, tmp_path: Path) -> None:
    assert validate(foreign(tmp_path, habit)) == [Finding("runs", text)]


@needs_compiler
@pytest.mark.parametrize(
    ("old", "new", "found"),
    [
        ('start="0 0"', 'start="0 0.5"', "u[2]: start = 0.5, but freshly instantiated it is 0.0"),
        ('start="0 0"', 'start="0.5"', "u[1]: start = 0.5, but freshly instantiated it is 0.0"),  # of all elements
        ('"tunable" start="1"', '"tunable" start="1.1"', "gain: start = 1.1, but freshly instantiated it is 1.0"),
        ('name="on" valueReference="3" causality="input" start="true"', 'name="on" valueReference="3" '
         'causality="input" start="false"', "on: start = false, but freshly instantiated it is True"),
    ],
)  # fmt: skip
def test_starts_are_there_from_the_beginning_element_by_element(old: str, new: str, found: str, tmp_path: Path) -> None:
    assert Finding("start-values", found) in validate(foreign(tmp_path, old=old, new=new))


@needs_compiler
def test_what_ticks_with_a_clock_is_said_not_to_be_looked_at(tmp_path: Path) -> None:
    path = foreign(tmp_path, old="  </ModelVariables>", new=f"{CLOCK}</ModelVariables>")
    assert validate(path) == [
        Finding("capabilities", "hasEventMode = false: expected true, for the clocks tick"),
        Finding("runs", "tick: not checked, as clocks tick in event mode only, in which it does not run", note=True),
    ]


# -- descriptions made for one rule ---------------------------------------------------------------------

STATE = """<Float64 name="time" valueReference="9" causality="independent"/>
<Float64 name="x" valueReference="0" initial="exact" start="1"/>
<Float64 name="der(x)" valueReference="1" derivative="0"/>
<Float64 name="y" valueReference="2" causality="output"/>
<Float64 name="p" valueReference="3" causality="calculatedParameter"/>
<Float64 name="u" valueReference="4" causality="input" start="0"/>
<Float64 name="k" valueReference="5" causality="parameter" start="0"/>
<Int32 name="n" valueReference="6" initial="exact" start="0"/>"""


def text_of(variables: str, structure: str = "", interface: str = "") -> str:
    """A description with these elements."""
    return f"""<fmiModelDescription fmiVersion="3.0" instantiationToken="t" variableNamingConvention="structured">
        <CoSimulation modelIdentifier="M" {interface}/><ModelVariables>{variables}</ModelVariables>
        <ModelStructure>{structure}</ModelStructure></fmiModelDescription>"""


def fmu(variables: str, structure: str = "", interface: str = "") -> Fmu:
    """The view of a description with these elements."""
    return view_of(text_of(variables, structure, interface))


def listed(**references: str) -> str:
    return "".join(f'<{name} valueReference="{each}"/>' for name, all in references.items() for each in all.split())


@pytest.mark.parametrize(
    ("structure", "texts"),
    [
        (listed(Output="2", ContinuousStateDerivative="1", InitialUnknown="3 2 1"), []),  # in any order
        (
            listed(Output="2", ContinuousStateDerivative="1", InitialUnknown="3 1"),
            ["InitialUnknown: y is there 0 times, expected once"],
        ),
        (
            listed(Output="2 4", InitialUnknown="2 2 3"),
            ["Output: u is there, expected it not to be", "InitialUnknown: y is there 2 times, expected once"],
        ),
    ],
)  # fmt: skip
def test_the_structure_holds_what_fmi_asks_for(structure: str, texts: list[str]) -> None:
    view = fmu(STATE, structure)
    assert [text for rule in RULES for text in rule(view)] == texts


@pytest.mark.parametrize(
    ("variables", "structure", "texts"),
    [
        (STATE, listed(Output="2", InitialUnknown="2 3", EventIndicator="77", ClockedState="78"),
         ["EventIndicator: valueReference 77, expected that of a variable",
          "ClockedState: valueReference 78, expected that of a variable"]),
        ('<Int32 name="n" valueReference="0" clocks="9"/>', "",
         ["n: clocks of valueReference 9, expected that of a variable"]),
        ('<Int32 name="n" valueReference="0" previous="9"/>', "",
         ["n: previous of valueReference 9, expected that of a variable"]),
        ('<Float64 name="a" valueReference="0"><Dimension valueReference="9"/></Float64>', "",
         ["a: dimension of valueReference 9, expected that of a variable"]),
        ('<Float64 name="a" valueReference="0" start="1"><Dimension valueReference="0"/></Float64>', "",
         ["a: its dimension is a of Float64: expected a structural or constant UInt64"]),
        ('<Float64 name="a" valueReference="0"/><Int32 name="b" valueReference="0"/>', "",
         ["a, b: value reference 0 for all of them, but FMI 3.0 has one for each variable"]),
        ('<Float64 name="d" valueReference="0" derivative="9"/>', "",
         ["d: derivative of valueReference 9, expected that of a variable"]),
    ],
)  # fmt: skip
def test_every_reference_is_that_of_a_variable(variables: str, structure: str, texts: list[str]) -> None:
    assert list(indices(fromstring(text_of(variables, structure)))) == texts


@pytest.mark.parametrize(
    ("where", "dependencies", "texts"),
    [
        ("Output", "4 0 5 6 9", []),  # an input, a state, a parameter, a discrete state, the time; in any order
        ("Output", "3", ["Output: y depends on p, a calculatedParameter: expected an input"]),
        ("InitialUnknown", "5 4 6", []),
        ("InitialUnknown", "1", ["InitialUnknown: y depends on der(x), a local: expected an input"]),
    ],
)
def test_dependencies_are_on_what_is_known(where: str, dependencies: str, texts: list[str]) -> None:
    structure = f'<{where} valueReference="2" dependencies="{dependencies}"/>'
    assert list(known_dependencies(fmu(STATE, structure))) == texts


def test_an_output_that_ticks_is_no_initial_unknown() -> None:
    ticking = f'{CLOCK}<Int32 name="count" valueReference="20" causality="output" clocks="7"/>'
    for initial, texts in (("", []), ("20", ["InitialUnknown: count is there, expected it not to be"])):
        view = fmu(ticking, listed(Output="20", InitialUnknown=initial))
        assert [text for rule in RULES for text in rule(view)] == texts


@pytest.mark.parametrize(
    ("rule", "variables", "text"),
    [
        (names, '<Float64 name="a" valueReference="0"><Alias name="a b"/></Float64>',
         "'a b': expected a name by the convention structured"),
        (arrays, '<Int32 name="n" valueReference="0" start="2" causality="parameter"/>'
         '<Float64 name="a" valueReference="1"><Dimension valueReference="0"/></Float64>',
         "a: its dimension is n, a fixed parameter of Int32: expected a structural or constant UInt64"),
        (arrays, '<UInt64 name="n" valueReference="0" start="2" causality="structuralParameter">'
         '<Dimension start="1"/></UInt64>', "n: a structural parameter with dimensions, expected a scalar"),
        (arrays, '<Float64 name="a" valueReference="1" start="1 2 3"><Dimension start="2"/></Float64>',
         "a: it starts with 3 values, expected 1 or 2"),
        (bounds, '<Float64 name="a" valueReference="0" start="1 3" max="2"><Dimension start="2"/></Float64>',
         "a: start = 3, expected at most max = 2"),
    ],
)  # fmt: skip
def test_what_fmi_2_has_not_is_looked_at(rule: Rule[Fmu], variables: str, text: str) -> None:
    assert list(rule(fmu(variables))) == [text]


@pytest.mark.parametrize(
    ("interface", "texts"),
    [
        ("", []),
        ('canSerializeFMUState="true"', ["canGetAndSetFMUState = false: expected true, since canSerializeFMUState is"]),
        (
            'canReturnEarlyAfterIntermediateUpdate="true"',
            ["providesIntermediateUpdate = false: expected true, since canReturnEarlyAfterIntermediateUpdate is"],
        ),
    ],
)
def test_capabilities_go_together(interface: str, texts: list[str]) -> None:
    assert list(capabilities(fmu(STATE, interface=interface))) == texts


def test_arrays_have_the_size_that_a_variable_starts_with() -> None:
    view = fmu(
        '<UInt64 name="n" valueReference="0" causality="structuralParameter" start="2"/>'
        '<Float64 name="A" valueReference="1" causality="parameter" start="1 2 3 4 5 6">'
        '<Dimension valueReference="0"/><Dimension start="3"/></Float64>'
        '<String name="s" valueReference="2" causality="parameter"><Dimension start="2"/>'
        '<Start value="one"/><Start value="two words"/></String>'
        '<Binary name="b" valueReference="3" causality="input"><Start value="00ff"/></Binary>'
    )
    starts = {v.name: start_value(v) for declared in view.variables for v in scalars_of(declared)}
    assert starts == {
        "n": 2, "A[1,1]": 1.0, "A[1,2]": 2.0, "A[1,3]": 3.0, "A[2,1]": 4.0, "A[2,2]": 5.0, "A[2,3]": 6.0,
        "s[1]": "", "s[2]": "", "b": b"\x00\xff",
    }  # fmt: skip


def test_bytes_that_are_none_cannot_be_read() -> None:
    with pytest.raises(UnreadableFmuError, match="b: start = xy, expected hexadecimal bytes"):
        fmu('<Binary name="b" valueReference="3" causality="input"><Start value="xy"/></Binary>')
