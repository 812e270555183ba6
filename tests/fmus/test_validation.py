"""Validation of FMUs that are sound, of this project and of others, and rules that no damage of ours can reach."""

import re
import sys
import zipfile
from collections.abc import Callable
from pathlib import Path
from xml.etree.ElementTree import Element, SubElement, fromstring, tostring

import pytest
from fmpy import read_model_description
from fmpy.model_description import ValidationError

from orchestration.command import cli
from orchestration.components.building.models import MODELS
from orchestration.components.checks.validation import confined_process, run_rules
from orchestration.components.checks.validation.finding import Finding
from orchestration.components.checks.validation.fmu import Fmu
from orchestration.components.checks.validation.own_rules import differences, elements
from orchestration.components.checks.validation.probe import Probe
from orchestration.components.checks.validation.progress import Frame, ReceivedReport, Reporter
from orchestration.components.checks.validation.structure import initial_unknowns, known_dependencies, outputs
from orchestration.components.checks.validation.validator import validate
from orchestration.components.checks.validation.variables import aliases, dimensions, names, unit_meaning
from orchestration.components.fmi.instance import start_value
from orchestration.components.fmi.read_description import attribute, scalars_of
from orchestration.foundation.basics.errors import QuadcosimError
from orchestration.foundation.processes.child import Child, Ending
from orchestration.foundation.processes.resource_limits import Limits
from tests.extent import in_test_all, sample
from tests.fmus.archive import files_of, view_of
from tests.fmus.damage import Damage, description, root, source, without, write_fmu
from tests.fmus.foreign import lag, needs_compiler
from tests.fmus.process import run
from tests.places import ROOT

# -- sound FMUs -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("model", sample([*MODELS], 1))
def test_nothing_is_wrong_with_the_fmus_and_their_files_stay_as_they_are(model: str, built: dict[str, Path]) -> None:
    before = built[model].read_bytes()
    assert validate(str(built[model])) == []
    assert built[model].read_bytes() == before


@pytest.fixture(scope="module")
def low_pass(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The FMU that pythonfmu's own builder makes of a small slave."""
    folder = tmp_path_factory.mktemp("foreign")
    done = run(sys.executable, str(ROOT / "tests" / "fmus" / "scripts" / "low_pass.py"), str(folder))
    assert done.returncode == 0, done.stderr
    return Path(done.stdout.splitlines()[-1])


def test_of_a_foreign_fmu_only_what_breaks_the_standard_is_found(low_pass: Path) -> None:
    """pythonfmu writes no InitialUnknowns, which FMI asks for; what only this project asks for is not asked for."""
    assert [finding for finding in validate(low_pass) if finding.rule != "standard"] == [
        Finding("initial-unknowns", "InitialUnknowns: y is there 0 times, expected once"),
        Finding("initial-unknowns", "InitialUnknowns: steps is there 0 times, expected once"),
    ]


@needs_compiler
@pytest.mark.parametrize(
    ("macro", "rule", "words", "note"),
    [
        ("CREEPS", "repeatable", "after 80 steps more: expected a fixed parameter to stay what it is", False),
        ("LEAKS", "repeatable", "its memory grows by 8", True),
        ("UNWRITTEN", "repeatable", "if fresh memory has other contents: it reads what nobody has written", False),
    ],
)
def test_a_step_that_changes_what_is_fixed_or_misuses_memory_is_found(
    macro: str, rule: str, words: str, note: bool, tmp_path: Path
) -> None:
    (finding,) = validate(lag(tmp_path / "Lag.fmu", macro))
    assert (finding.rule, finding.note) == (rule, note)
    assert words in finding.text


@needs_compiler
def test_what_initial_unknowns_lacks_is_said_once(tmp_path: Path) -> None:
    listed = '<InitialUnknowns><Unknown index="2"/></InitialUnknowns>'
    path = lag(tmp_path / "Lag.fmu", described={listed: ""})
    assert validate(path) == [Finding("initial-unknowns", "InitialUnknowns: x is there 0 times, expected once")]


@needs_compiler
@pytest.mark.parametrize(
    ("given", "instead", "finding"),
    [
        (
            '<Outputs><Unknown index="2"/>',
            '<Outputs><Unknown index="9"/>',
            ("indices", "Outputs: index 9, expected 1 to"),
        ),
        ("<Real/>", '<Real displayUnit="mm"/>', ("standard", "a variable refers to a displayUnit without a unit;")),
    ],
)
def test_what_a_description_refers_to_in_vain_is_named_and_no_error_of_its_reader_is(
    given: str, instead: str, finding: tuple[str, str], tmp_path: Path
) -> None:
    (found,) = validate(lag(tmp_path / "Lag.fmu", described={given: instead}))
    rule, text = finding
    assert found.rule == rule
    assert found.text.startswith(text)


def damaged(fmu: Path, path: Path, *damages: Damage) -> Path:
    files = files_of(fmu)
    for damage in damages:
        damage(files)
    write_fmu(path, files)
    return path


def list_initial_unknowns(root: Element) -> None:
    structure = root.find("ModelStructure")
    assert structure is not None
    unknowns = SubElement(structure, "InitialUnknowns")
    for index in (2, 6):
        SubElement(unknowns, "Unknown", index=str(index))


LISTED = description(list_initial_unknowns)


def test_nothing_is_wrong_with_a_foreign_fmu_that_lists_its_initial_unknowns(low_pass: Path, tmp_path: Path) -> None:
    assert validate(damaged(low_pass, tmp_path / "listed.fmu", LISTED)) == []


def test_what_a_foreign_fmu_does_is_looked_at_too(low_pass: Path, tmp_path: Path) -> None:
    lag = "(target - self.y) * min(1.0, step_size / self.tau)"
    path = damaged(
        low_pass, tmp_path / "shared.fmu", LISTED,
        source("low_pass.py", "class LowPass", "SHARED = [0.0]\n\n\nclass LowPass"),
        source("low_pass.py", f"self.y += {lag}", f"SHARED[0] += {lag}; self.y = SHARED[0]"),
    )  # fmt: skip
    found = validate(path)
    assert [(finding.rule, finding.note) for finding in found] == [("repeatable", True)]
    assert all("y = " in finding.text for finding in found)


def test_an_fmu_that_cannot_run_here_is_not_said_to_be_sound(low_pass: Path, tmp_path: Path) -> None:
    path = damaged(
        low_pass, tmp_path / "elsewhere.fmu", LISTED, without("binaries/linux64/"), without("binaries/win64/")
    )
    rules = [finding.rule for finding in validate(path)]
    assert rules == ["binaries", "platform"]


# -- FMUs in C, as other tools make them ----------------------------------------------------------------


def summary(path: Path, **limits: float) -> list[tuple[str, bool]]:
    """Rule of each finding, and whether it is a note only."""
    return [(finding.rule, finding.note) for finding in validate(path, limits=Limits(**limits))]


@needs_compiler
@pytest.mark.parametrize(
    ("macro", "found"),
    [
        ("PLAIN", []),
        ("NOISY", [("repeatable", True)]),  # rand() breaks no rule
        ("SHIFT=1e-9", [("saved-state", True), ("serialised-state", True)]),  # the simulation can go on
        ("SHIFT=1e-2", [("saved-state", False), ("serialised-state", False)]),
        ("FORKS", []),
        ("ENDLESS", [("stop-time", False)]),
    ],
)
def test_only_what_breaks_the_standard_is_a_problem(macro: str, found: list[tuple[str, bool]], tmp_path: Path) -> None:
    assert summary(lag(tmp_path / "lag.fmu", macro)) == found


@needs_compiler
@pytest.mark.parametrize(
    ("start", "found"),
    [("0.1", []), ("0.10000000000000002", []), ("0.1000000001", [("start-values", False)])],
)
def test_a_start_may_be_off_by_what_15_digits_leave_open(start: str, found: list[object], tmp_path: Path) -> None:
    path = lag(tmp_path / "lag.fmu", described={'<Real start="0.1"/>': f'<Real start="{start}"/>'})
    assert summary(path) == found


@in_test_all
@needs_compiler
def test_a_slow_fmu_is_checked_with_fewer_steps(tmp_path: Path) -> None:
    assert summary(lag(tmp_path / "lag.fmu", "SLOW=5000"), time=8.0) == [("runs", True)]


@needs_compiler
def test_what_an_fmu_logs_is_formatted(tmp_path: Path) -> None:
    (found,) = validate(lag(tmp_path / "lag.fmu", "REFUSES"))
    assert found == Finding("runs", "fmi2DoStep: Lag 0: 7 of 0 at 100%")


@needs_compiler
@pytest.mark.parametrize("macro", ["EXITS", "EXIT_AT_ONCE"])
def test_an_fmu_that_ends_its_process_in_good_order_does_not_pass(macro: str, tmp_path: Path) -> None:
    *_, found = validate(lag(tmp_path / "lag.fmu", macro))
    assert found.rule == "process"
    assert found.text.startswith("the process of the FMU ended with exit code 0 in ")


@needs_compiler
@pytest.mark.parametrize(
    ("macro", "limits", "words"),
    [
        ("TALKS", {"output": 1.0}, "it writes more than the limit of 1 MB to its standard output and error"),
        ("HOARDS", {"memory": 500.0}, "it takes more memory than the limit of 500 MB"),
    ],
)
def test_an_fmu_that_takes_too_much_is_stopped(
    macro: str, limits: dict[str, float], words: str, tmp_path: Path
) -> None:
    *_, found = validate(lag(tmp_path / "lag.fmu", macro), limits=Limits(**limits))
    where, _, what = found.text.partition(": ")
    assert found.rule == "process"
    assert where.startswith("stopped in ")  # whichever rule was under way when it was seen
    assert what == f"{words}; the rest was not checked"


def test_the_time_limit_holds_for_the_description_too(low_pass: Path, tmp_path: Path) -> None:
    def swell(root: Element) -> None:
        variables = root.find("ModelVariables")
        assert variables is not None
        for i in range(100_000):
            v = SubElement(variables, "ScalarVariable", name=f"v{i}", valueReference=str(100 + i))
            SubElement(v, "Real")

    path = damaged(low_pass, tmp_path / "large.fmu", description(swell))
    (found,) = (finding for finding in validate(path, limits=Limits(time=1.5)) if finding.rule == "process")
    assert found.text.endswith("it takes longer than the limit of 1.5 s; the rest was not checked")


def test_an_archive_of_zeros_is_refused_before_it_is_unpacked(low_pass: Path, tmp_path: Path) -> None:
    path = damaged(low_pass, tmp_path / "zeros.fmu")
    with zipfile.ZipFile(path, "a", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("resources/zeros", bytes(20_000_000))
    (found,) = validate(path, limits=Limits(size=10.0))
    assert found == Finding("readable", "unpacks to 21 MB: expected at most 10 MB (--size-limit)")


def test_an_fmu_of_fmi_1_is_told_by_its_version(low_pass: Path, tmp_path: Path) -> None:
    path = damaged(low_pass, tmp_path / "one.fmu", root(fmiVersion="1.0"), without("binaries/"))
    (found,) = validate(path)
    assert found.rule == "readable"
    assert found.text.startswith("fmiVersion = 1.0: expected an FMU with a valid modelDescription.xml")


# -- the command ----------------------------------------------------------------------------------------


def test_a_file_that_is_no_fmu_is_one_problem(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "no.fmu"
    path.write_bytes(b"not an archive")
    with pytest.raises(SystemExit) as end:
        cli.main(["validate", str(path)])
    assert end.value.code == 1
    verdict, first, second = capsys.readouterr().out.splitlines()
    assert verdict == "1 problem in the FMU"
    assert first == f"{path}: 1 problem"
    assert second.startswith("  readable: expected a zip archive that is whole: ")


@pytest.mark.parametrize("limit", ["0", "-1", "nan"])
def test_a_time_limit_must_be_positive(limit: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as end:
        cli.main(["validate", f"--time-limit={limit}"])
    assert end.value.code == 2
    assert f"--time-limit {limit}: expected a positive number of seconds" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("report", "words"), [([], "no such module"), ([("begin", "runs"), ("failed", "KeyError: 3")], "KeyError: 3")]
)
def test_an_error_of_the_validation_itself_is_no_finding(
    report: list[Frame], words: str, low_pass: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(child: Child, hear: Callable[[Frame], None]) -> Ending:
        for frame in report:
            hear(frame)
        return Ending(code=1, last_line="no such module")

    monkeypatch.setattr(Child, "receive_all", fail)
    with pytest.raises(QuadcosimError, match=f"LowPass.fmu: the validation failed: {words}"):
        validate(low_pass)


@pytest.mark.parametrize(("spent", "words"), [(41.0, "a call does not return"), (39.0, "its calls return, it is slow")])
def test_whether_a_call_hangs_is_told_by_the_time_of_the_process(
    spent: float, words: str, low_pass: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    times = iter([10.0, spent])

    def out_of_time(child: Child, hear: Callable[[Frame], None]) -> Ending:
        hear(("begin", "runs"))
        hear(("beat", 0.5))
        hear(("crashed", "law.c:7 (loop)"))
        return Ending(code=None, reached="it is late", out_of_time=True)

    monkeypatch.setattr(Child, "spent", property(lambda child: next(times)))
    monkeypatch.setattr(Child, "receive_all", out_of_time)
    (found,) = validate(low_pass, limits=Limits(time=60.0))
    place = "in runs, after t = 0.5 s, at law.c:7 (loop)"
    assert found.text == f"stopped {place}: it is late; {words}; the rest was not checked"


def test_the_child_reports_an_error_in_a_rule(low_pass: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    def odd(probe: Probe) -> list[str]:
        raise KeyError(3)

    monkeypatch.setattr(run_rules, "FIRST", (odd,))
    monkeypatch.setattr(confined_process, "restrict", lambda size: None)  # which would hold for the process of the test
    received = ReceivedReport()
    with pytest.raises(KeyError):
        confined_process.check(low_pass, tmp_path, Limits(), Reporter(received.receive))
    assert (received.rule, received.error, received.ended) == ("odd", "KeyError: 3", False)


# -- units ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("1", {}),
        ("m/s2", {"m": 1, "s": -2}),
        ("1/s", {"s": -1}),
        ("N.m.s", {"kg": 1, "m": 2, "s": -1}),
        ("s-1", {"s": -1}),
        ("J/(kg.K)", {"m": 2, "s": -2, "K": -1}),
        ("W/m2", {"kg": 1, "s": -3}),
        ("rad/s", {"rad": 1, "s": -1}),
    ],
)
def test_the_name_of_a_unit_means_its_base_units(name: str, expected: dict[str, int]) -> None:
    found = dimensions(name)
    assert found is not None
    assert {symbol: n for symbol, n in found.items() if n} == expected


@pytest.mark.parametrize("name", ["degC", "rpm", "mm", "m^2", "kg m", "", "m/s/s", "Hz", "%"])
def test_of_other_names_nothing_is_claimed(name: str) -> None:
    assert dimensions(name) is None


# -- descriptions made for one rule ---------------------------------------------------------------------


def fmu(variables: str, structure: str = "", units: str = "", tool: str = "another") -> Fmu:
    """The view of a description with these elements."""
    text = f"""<fmiModelDescription fmiVersion="2.0" modelName="M" guid="g" generationTool="{tool}">
        <CoSimulation modelIdentifier="M"/><UnitDefinitions>{units}</UnitDefinitions>
        <ModelVariables>{variables}</ModelVariables><ModelStructure>{structure}</ModelStructure>
    </fmiModelDescription>"""
    return view_of(text)


def named(convention: str | None, *names: str) -> Element:
    """A description with variables of these names."""
    attribute = {} if convention is None else {"variableNamingConvention": convention}
    root = Element("fmiModelDescription", {"fmiVersion": "2.0", "modelName": "M", "guid": "g", **attribute})
    SubElement(root, "CoSimulation", modelIdentifier="M")
    variables = SubElement(root, "ModelVariables")
    for i, name in enumerate(names):
        SubElement(SubElement(variables, "ScalarVariable", name=name, valueReference=str(i)), "Real")
    SubElement(root, "ModelStructure")
    return root


def illegal(convention: str | None, *given: str) -> list[str]:
    return list(names(view_of(tostring(named(convention, *given), encoding="unicode"))))


STRUCTURED = ["mass", "_1", "a.b[1,2].c", "der(x)", "der(a.b[1].c)", "der(x,2)", "'odd name'.x", "'a'[3]", "der"]
NOT_STRUCTURED = [
    "", "1a", "a b", "a..b", "a.", ".a", "a[", "a[]", "a[x]", "a[1", "der(der(x))", "der(x", "$cse1", "''", "'a", "ä",
]  # fmt: skip


def test_names_are_structured_by_the_grammar_of_the_standard() -> None:
    assert illegal("structured", *STRUCTURED, r"'it\'s'") == []
    assert illegal("structured", *NOT_STRUCTURED) == [
        f"{name!r}: expected a name by the convention structured" for name in NOT_STRUCTURED
    ]


def test_fmpy_calls_the_same_names_structured(tmp_path: Path) -> None:
    path = tmp_path / "modelDescription.xml"
    path.write_bytes(tostring(named("structured", *STRUCTURED, *NOT_STRUCTURED)))
    with pytest.raises(ValidationError) as caught:
        read_model_description(str(path), validate_variable_names=True)
    found = [re.match(r'"(.*)" \(line .* is not a legal variable name', text) for text in caught.value.problems]
    assert [match[1] for match in found if match] == NOT_STRUCTURED


@pytest.mark.parametrize("convention", ["flat", None])
def test_flat_names_are_any_text_on_one_line(convention: str | None) -> None:
    assert illegal(convention, "any thing, at all", "two\nlines") == [
        "'two\\nlines': expected a name by the convention flat"
    ]


def scalar(name: str, reference: int, attributes: str = "", real: str = "") -> str:
    return f'<ScalarVariable name="{name}" valueReference="{reference}" {attributes}><Real {real}/></ScalarVariable>'


@pytest.mark.parametrize(
    ("first", "second", "problem"),
    [
        (('causality="input"', 'start="0"'), ('causality="output"', ""), None),
        (("", ""), ("", ""), None),
        (('variability="constant"', 'start="1"'), ('variability="constant"', 'start="1"'), None),
        (('variability="constant"', 'start="1"'), ('variability="constant"', 'start="2"'), "different starts"),
        (('variability="constant"', 'start="1"'), ("", ""), "only some are constants"),
        (('causality="input"', 'start="0"'), ('causality="input"', 'start="0"'), "set from outside"),
        (('initial="exact"', 'start="0"'), ('initial="exact"', 'start="0"'), "more than one of them has a start"),
        (("", 'unit="m"'), ("", 'unit="s"'), "their units are m, s"),
    ],
)
def test_aliases_are_one_value(first: tuple[str, str], second: tuple[str, str], problem: str | None) -> None:
    texts = list(aliases(fmu(scalar("a", 7, *first) + scalar("b", 7, *second))))
    assert len(texts) == (problem is not None)
    if problem is not None:
        assert texts[0].startswith("a, b: value reference 7 for all of them")
        assert problem in texts[0]


STATE = (
    scalar("x", 0, 'initial="exact"', 'start="1"')
    + scalar("der(x)", 1, "", 'derivative="1"')
    + scalar("y", 2, 'causality="output"')
    + scalar("p", 3, 'causality="calculatedParameter" variability="fixed"')
    + scalar("u", 4, 'causality="input"', 'start="0"')
)


def lists(outputs: str, derivatives: str, initial: str) -> str:
    def listed(indices: str) -> str:
        return "".join(f'<Unknown index="{index}"/>' for index in indices.split())

    return (
        f"<Outputs>{listed(outputs)}</Outputs><Derivatives>{listed(derivatives)}</Derivatives>"
        f"<InitialUnknowns>{listed(initial)}</InitialUnknowns>"
    )


@pytest.mark.parametrize(
    ("structure", "texts"),
    [
        (lists("3", "2", "2 3 4"), []),
        (lists("3", "3", "3 4"), []),  # x is no state: its derivative is not under Derivatives
        (lists("3", "", "3 4"), []),  # without derivatives there are no states to speak of
        (lists("3", "2", "3 2 4"), ["InitialUnknowns: expected the entries in the order of their indices"]),
        (lists("3", "2", "2 3"), ["InitialUnknowns: p is there 0 times, expected once"]),
        (lists("3", "2", "2 3 3 4"), ["InitialUnknowns: y is there 2 times, expected once"]),
        (lists("3", "2", "1 2 3 4"), ["InitialUnknowns: x is there, expected it not to be"]),
        (lists("3 4", "2", "2 3 4"), ["Outputs: p is there, expected it not to be"]),
    ],
)
def test_the_lists_of_the_structure_hold_what_fmi_asks_for(structure: str, texts: list[str]) -> None:
    assert [*outputs(view := fmu(STATE, structure)), *initial_unknowns(view)] == texts


@pytest.mark.parametrize(
    ("where", "dependencies", "texts"),
    [
        ("Outputs", "1 5", []),
        ("Outputs", "5 1", ["Outputs: y: expected its dependencies once each, in the order of their indices"]),
        ("Outputs", "4", ["Outputs: y depends on p, a calculatedParameter: expected an input"]),
        ("InitialUnknowns", "1 5", []),
        ("InitialUnknowns", "2", ["InitialUnknowns: y depends on der(x), a local: expected an input"]),
    ],
)
def test_dependencies_are_on_what_is_known(where: str, dependencies: str, texts: list[str]) -> None:
    structure = f'<{where}><Unknown index="3" dependencies="{dependencies}"/></{where}>'
    assert list(known_dependencies(fmu(STATE, structure))) == texts


RADIAN_LEFT_OUT = '<Unit name="rad/s"><BaseUnit s="-1"/></Unit>'


def test_others_may_take_the_radian_for_one() -> None:
    assert list(unit_meaning(fmu("", units=RADIAN_LEFT_OUT))) == []
    assert list(unit_meaning(fmu("", units=RADIAN_LEFT_OUT, tool="quadcosim"))) == [
        "unit rad/s: base units s=-1, expected s=-1 rad=1"
    ]


def test_types_give_variables_their_attributes() -> None:
    text = """<fmiModelDescription fmiVersion="2.0" guid="g"><CoSimulation modelIdentifier="M"/><TypeDefinitions>
        <SimpleType name="Angle"><Real unit="rad" min="-1" max="1"/></SimpleType>
        <SimpleType name="Gear"><Enumeration><Item name="r" value="-1"/><Item name="d" value="1"/></Enumeration>
        </SimpleType></TypeDefinitions><ModelVariables>
        <ScalarVariable name="a" valueReference="0"><Real declaredType="Angle" max="2"/></ScalarVariable>
        <ScalarVariable name="g" valueReference="0"><Enumeration declaredType="Gear" start="1"/></ScalarVariable>
        </ModelVariables></fmiModelDescription>"""
    a, g = view_of(text).variables
    assert [attribute(a, name) for name in ("unit", "min", "max")] == ["rad", "-1", "2"]
    (angle,), (gear,) = scalars_of(a), scalars_of(g)
    assert (angle.unit, angle.minimum, angle.maximum) == ("rad", -1.0, 2.0)
    assert (gear.choices, start_value(gear)) == ({"r": -1, "d": 1}, 1)


# -- two descriptions -----------------------------------------------------------------------------------

MINE = '<d a="1"><Units><Unit name="m"><BaseUnit m="1"/></Unit></Units><List><Unknown index="3"/></List></d>'


@pytest.mark.parametrize(
    ("change", "texts"),
    [
        (lambda text: text, []),
        (lambda text: text.replace('a="1"', 'a="1" guid="g"'), []),
        (lambda text: text.replace('m="1"', 'm="2"'), ["Units, Unit m, BaseUnit: m = 1, expected 2"]),
        (lambda text: text.replace('name="m"', 'name="s"'), ["Units, Unit s: expected it", "Units, Unit m: found it"]),
        (lambda text: text.replace('index="3"', 'index="3" dependencies=""'), ["dependencies = None, expected "]),
        (
            lambda text: text.replace("</List>", '<Unknown index="3"/></List>'),
            ["List, Unknown 3 again: expected it as in the bundled slave, found none"],
        ),
        (
            lambda text: '<d a="1"><List><Unknown index="3"/></List>' + text[9 : text.index("<List>")] + "</d>",
            ["Units: expected List in its place"],
        ),
    ],
)
def test_a_difference_between_descriptions_is_named(change: Callable[[str], str], texts: list[str]) -> None:
    found = list(differences(elements(fromstring(MINE)), elements(fromstring(change(MINE)))))
    assert len(found) == len(texts)
    assert all(text in whole for text, whole in zip(texts, found, strict=True))
