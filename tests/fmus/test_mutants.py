"""Validation bites: every way to damage an FMU is found, by the rule that is meant for it."""

import functools
import json
import os
from collections.abc import Callable, Mapping
from pathlib import Path

import pytest

from orchestration.command import cli
from orchestration.components.building import fmus
from orchestration.components.building.models import MODELS
from orchestration.components.checks.validation import rules
from orchestration.components.checks.validation.confined_process import PLATFORM, READABLE, check_description
from orchestration.components.checks.validation.finding import Finding, name_of
from orchestration.components.checks.validation.progress import ReceivedReport, Reporter
from orchestration.components.checks.validation.validator import PROCESS, validate
from orchestration.foundation.processes.resource_limits import Limits
from tests.extent import WHOLE, in_test_all, sample
from tests.fmus.damage import Mutant, every
from tests.fmus.faulty import faulty
from tests.fmus.making import PAIR
from tests.fmus.mutants import MUTANTS
from tests.fmus.process import run_script
from tests.fmus.scripts.find_mutants import WITHOUT_INSTANCES
from tests.fmus.stepped_from_outside import stepped_from_outside
from tests.fmus.verdicts import as_markdown, fmpy_finds, fmutool_finds, verdicts

BY_NAME = {mutant.name: mutant for mutant in MUTANTS}
OF_VERSIONS = [(version, mutant) for version in (2, 3) for mutant in MUTANTS if version in mutant.versions]

Findings = Callable[[int, Mutant], list[Finding]]
Make = Callable[[str], Path]


@pytest.fixture(scope="module")
def subjects(built: dict[str, Path], tmp_path_factory: pytest.TempPathFactory) -> Mapping[int, dict[str, Path]]:
    """The FMUs that are damaged, by the version of FMI and the model."""
    folder = tmp_path_factory.mktemp("faulty")
    known = {2: built, 3: {model: faulty(model, folder) for model in PAIR}}
    return {
        version: dict(of) | stepped_from_outside(version, tmp_path_factory.mktemp("from_outside"))
        for version, of in known.items()
    }


@pytest.fixture(scope="module")
def findings(subjects: Mapping[int, dict[str, Path]], tmp_path_factory: pytest.TempPathFactory) -> Findings:
    """What is found wrong with each mutant; those that run are run when the first of them is asked for."""
    folders = {version: tmp_path_factory.mktemp("mutants") for version in subjects}

    @functools.cache
    def of_those_that_run(version: int) -> dict[str, list[Finding]]:
        run = [mutant.name for of, mutant in TRIED if of == version and runs(mutant)]
        fmus = os.pathsep.join(map(str, subjects[version].values()))
        said = run_script("find_mutants", folders[version], fmus, *run)
        return {name: [Finding(*finding) for finding in found] for name, found in said.items()}

    @functools.cache
    def found(version: int, mutant: Mutant) -> list[Finding]:
        if runs(mutant):
            return of_those_that_run(version)[mutant.name]
        path = mutant.write(subjects[version][mutant.model], folders[version])
        ends = mutant.rule == PROCESS
        return validate(path, limits=Limits(time=mutant.time_limit)) if ends else looked_at(path)

    return found


def runs(mutant: Mutant) -> bool:
    """Whether it is found by what it does, and lives on."""
    return mutant.rule not in {*WITHOUT_INSTANCES, PROCESS}


def tried() -> list[tuple[int, Mutant]]:
    """Of those that run, one for each rule, in FMI 2.0 and 3.0 by turns; all others."""
    of_rules: dict[str, list[tuple[int, Mutant]]] = {}
    for version, mutant in OF_VERSIONS:
        if runs(mutant):
            of_rules.setdefault(mutant.rule_of(version), []).append((version, mutant))
    chosen = [cases[-(turn % 2)] for turn, cases in enumerate(of_rules.values())]
    return [each for each in OF_VERSIONS if each in chosen or not runs(each[1])]


TRIED = OF_VERSIONS if WHOLE else tried()


def looked_at(path: Path) -> list[Finding]:
    """What is found wrong with an FMU before it runs."""
    received = ReceivedReport()
    check_description(path, Limits().size, Reporter(received.receive))
    return received.findings


@pytest.fixture(scope="module")
def native() -> dict[str, Path]:
    """The FMUs without Python inside, which are looked through in less time."""
    return {model: fmus.locate(f"native/{model}") for model in PAIR}


@pytest.fixture
def make(native: dict[str, Path], tmp_path: Path) -> Make:
    """Makes the mutant of a name, of which the damage is not to the Python inside."""
    return lambda name: BY_NAME[name].write(native[BY_NAME[name].model], tmp_path)


# -- each of them ---------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("version", "mutant"),
    [pytest.param(*each, id=f"FMI-{each[0]}-{each[1].name.replace(' ', '-')}") for each in TRIED],
)
def test_the_rule_that_is_meant_for_it_finds_the_mutant(version: int, mutant: Mutant, findings: Findings) -> None:
    found = findings(version, mutant)
    texts = [finding.text for finding in found if finding.rule == mutant.rule_of(version)]
    words = " and ".join(map(repr, mutant.words_of(version)))
    assert any(all(word in text for word in mutant.words_of(version)) for text in texts), "\n".join(
        [
            f"{mutant.name}, of tests/fmus/mutants.py, in FMI {version}: expected the rule "
            f"{mutant.rule_of(version)} to find it, with {words} in its text; found:",
            *(map(str, found) if found else ["nothing"]),
        ]
    )
    assert not any("\n" in finding.text for finding in found)


@pytest.mark.parametrize(
    ("version", "without"),
    [(2, {"arrays", "clocks", "interfaces"}), (3, {"slave-module", "own-description", "aliases"})],
)
def test_every_rule_has_a_mutant_that_it_finds(version: int, without: set[str]) -> None:
    """FMI 2.0 has no arrays, clocks and event mode.

    FMI 3.0 has other aliases, and in its FMUs is no Python, as for two rules.
    """
    names = {name_of(rule) for rule in (*rules.STANDARD, *rules.OURS)} | {READABLE, PROCESS, PLATFORM}
    found = {mutant.rule_of(version) for of, mutant in OF_VERSIONS if of == version}
    assert found == names - without, (
        f"{', '.join(sorted(found ^ (names - without)))}: expected a mutant in MUTANTS of tests/fmus/mutants.py "
        f"for each rule of orchestration/components/checks/validation/rules.py"
    )


@pytest.mark.parametrize("model", PAIR)
def test_without_a_fault_nothing_is_wrong_with_what_faults_are_put_into(
    model: str, subjects: Mapping[int, dict[str, Path]]
) -> None:
    assert validate(subjects[3][model]) == []


def test_mutants_are_told_apart_by_their_names() -> None:
    assert len(BY_NAME) == len(MUTANTS)


@pytest.mark.parametrize("version", [2, 3])
def test_only_mutants_of_the_guid_are_given_away_by_it(version: int, findings: Findings) -> None:
    mutants = [mutant for of, mutant in TRIED if of == version]
    by_content = {m.name for m in mutants if any(f.rule == "guid-of-content" for f in findings(version, m))}
    assert by_content == {
        "empty GUID",
        "GUID of another content",
        "source changed, GUID not",
        "two files of one name",  # of which only one can be the content
    }


@pytest.mark.parametrize(
    "names", [("start not a number",), ("name twice", "GUID of another content", "unit without base units")]
)
def test_what_a_look_finds_the_whole_validation_finds_too(
    names: tuple[str, ...], built: dict[str, Path], tmp_path: Path
) -> None:
    damage = every(*(BY_NAME[name].damage for name in names))
    path = Mutant(name="it", rule="", words=(), damage=damage, keeps_guid=True).write(built["QuadrotorPlant"], tmp_path)
    found = looked_at(path)
    assert {BY_NAME[name].rule for name in names} <= {finding.rule for finding in found}
    assert validate(path)[: len(found)] == found


@pytest.mark.parametrize("name", ["stop before start", "start of another length", "array of no elements"])
def test_one_that_is_described_oddly_is_looked_at_to_the_end(
    name: str, subjects: Mapping[int, dict[str, Path]], tmp_path: Path
) -> None:
    path = BY_NAME[name].write(subjects[3]["QuadrotorPlant"], tmp_path)
    assert {finding.rule for finding in validate(path)} == {BY_NAME[name].rule}


# -- on the command line --------------------------------------------------------------------------------


@pytest.mark.parametrize("name", sample(["process crashes", "date in local time", "archive cut short", "FMI 1"], 1))
def test_the_command_names_what_it_finds_and_ends_with_1(
    name: str, built: dict[str, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = BY_NAME[name].write(built["QuadrotorPlant"], tmp_path)
    with pytest.raises(SystemExit) as end:
        cli.main(["validate", str(path)])
    assert end.value.code == 1
    verdict, first, *lines = capsys.readouterr().out.splitlines()
    assert verdict == f"{len(lines)} problem{'s' if len(lines) > 1 else ''} in the FMU"
    assert first == f"{path}: {len(lines)} problem{'s' if len(lines) > 1 else ''}"
    assert any(line.startswith(f"  {BY_NAME[name].rule}: ") for line in lines)
    assert all(line.startswith("  ") for line in lines)


def test_the_command_gives_findings_as_json(
    make: Make, native: dict[str, Path], capsys: pytest.CaptureFixture[str]
) -> None:
    damaged, sound = make("needs a tool"), native["QuadrotorPlant"]
    with pytest.raises(SystemExit) as end:
        cli.main(["validate", "--json", str(damaged), str(sound)])
    assert end.value.code == 1
    document = json.loads(capsys.readouterr().out)
    first, second = document["fmus"]
    assert document["verdict"].endswith(" in 2 FMUs")
    assert first["fmu"] == str(damaged)
    text = "needsExecutionTool = true: expected false"
    assert {"rule": "execution-tool", "text": text, "note": False} in first["findings"]
    assert second == {"fmu": str(sound), "findings": []}


def test_the_command_stops_an_fmu_at_the_time_limit(
    built: dict[str, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = BY_NAME["step without end"].write(built["QuadrotorPlant"], tmp_path)
    with pytest.raises(SystemExit) as end:
        cli.main(["validate", "--time-limit", "2", str(path)])
    assert end.value.code == 1
    assert "it takes longer than the limit of 2 s" in capsys.readouterr().out


# -- what others say ------------------------------------------------------------------------------------


@in_test_all
@pytest.mark.parametrize("model", MODELS)
def test_the_checkers_of_others_find_nothing_wrong_with_the_fmus(model: str, built: dict[str, Path]) -> None:
    assert fmpy_finds(built[model]) == []
    assert fmutool_finds(built[model]) == []


@in_test_all
def test_an_empty_guid_passes_the_checkers_of_others(make: Make) -> None:
    path = make("empty GUID")
    assert fmpy_finds(path) == []
    assert fmutool_finds(path) == []


def test_the_table_says_who_notices_what(native: dict[str, Path], tmp_path: Path) -> None:
    chosen = [BY_NAME[name] for name in ("name twice", "empty GUID", "description not XML")]
    table = verdicts(chosen, native, tmp_path)
    assert [(bool(verdict.fmpy), bool(verdict.fmutool)) for verdict in table] == [
        (True, True), (False, False), (True, True),
    ]  # fmt: skip
    assert as_markdown({2: table, 3: table[:1]}).splitlines() == [
        "| damage | rule | FMI 2.0: quadcosim | fmpy | fmutool | FMI 3.0: quadcosim | fmpy | fmutool |",
        "|---|---|---|---|---|---|---|---|",
        "| name twice | `standard` | yes | yes | yes | yes | yes | yes |",
        "| empty GUID | `guid` | yes | - | - |  |  |  |",
        "| description not XML | `readable` | yes | yes | yes |  |  |  |",
    ]
