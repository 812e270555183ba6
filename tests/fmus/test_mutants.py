"""Validation bites: every way to damage an FMU is found, by the rule that is meant for it."""

import functools
import json
import os
from collections.abc import Callable
from pathlib import Path

import pytest

from orchestration.building import fmus
from orchestration.building.models import MODELS
from orchestration.checks.validation import rules
from orchestration.checks.validation.confined_process import PLATFORM, READABLE, look
from orchestration.checks.validation.finding import Finding, name_of
from orchestration.checks.validation.progress import Report, Told
from orchestration.checks.validation.validator import PROCESS, validate
from orchestration.command import cli
from orchestration.processes.limits import Limits
from tests.fmus.damage import Mutant, every
from tests.fmus.making import PAIR
from tests.fmus.mutants import MUTANTS
from tests.fmus.process import run_script
from tests.fmus.scripts.find_mutants import WITHOUT_INSTANCES
from tests.fmus.verdicts import as_markdown, fmpy_finds, fmutool_finds, verdicts

BY_NAME = {mutant.name: mutant for mutant in MUTANTS}

Findings = Callable[[Mutant], list[Finding]]
Make = Callable[[str], Path]


@pytest.fixture(scope="module")
def findings(built: dict[str, Path], tmp_path_factory: pytest.TempPathFactory) -> Findings:
    """What is found wrong with each mutant; those that run are run when the first of them is asked for."""
    folder = tmp_path_factory.mktemp("mutants")
    ends = [mutant for mutant in MUTANTS if mutant.rule == PROCESS]
    run = [mutant for mutant in MUTANTS if mutant.rule not in {*WITHOUT_INSTANCES, PROCESS}]

    @functools.cache
    def of_those_that_run() -> dict[str, list[Finding]]:
        said = run_script("find_mutants", folder, os.pathsep.join(map(str, built.values())), *(m.name for m in run))
        return {name: [Finding(*finding) for finding in found] for name, found in said.items()}

    @functools.cache
    def found(mutant: Mutant) -> list[Finding]:
        if mutant in run:
            return of_those_that_run()[mutant.name]
        path = mutant.write(built[mutant.model], folder)
        return validate(path, limits=Limits(time=mutant.time_limit)) if mutant in ends else looked_at(path)

    return found


def looked_at(path: Path) -> list[Finding]:
    """What is found wrong with an FMU before it runs."""
    told = Told()
    look(path, Limits().size, Report(told.hear))
    return told.findings


@pytest.fixture(scope="module")
def native() -> dict[str, Path]:
    """The FMUs without Python inside, which are looked through in less time."""
    return {model: fmus.locate(f"native/{model}") for model in PAIR}


@pytest.fixture
def make(native: dict[str, Path], tmp_path: Path) -> Make:
    """Makes the mutant of a name, of which the damage is not to the Python inside."""
    return lambda name: BY_NAME[name].write(native[BY_NAME[name].model], tmp_path)


# -- each of them ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("mutant", MUTANTS, ids=lambda mutant: mutant.name.replace(" ", "-"))
def test_the_rule_that_is_meant_for_it_finds_the_mutant(mutant: Mutant, findings: Findings) -> None:
    found = findings(mutant)
    texts = [finding.text for finding in found if finding.rule == mutant.rule]
    assert any(all(word in text for word in mutant.words) for text in texts), "\n".join(map(str, found))
    assert not any("\n" in finding.text for finding in found)


def test_every_rule_has_a_mutant_that_it_finds() -> None:
    names = {name_of(rule) for rule in (*rules.STANDARD, *rules.OURS)}
    assert {mutant.rule for mutant in MUTANTS} == names | {READABLE, PROCESS, PLATFORM}


def test_mutants_are_told_apart_by_their_names() -> None:
    assert len(BY_NAME) == len(MUTANTS)


def test_only_mutants_of_the_guid_are_given_away_by_it(findings: Findings) -> None:
    by_content = {m.name for m in MUTANTS if any(finding.rule == "guid-of-content" for finding in findings(m))}
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


# -- on the command line --------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["date in local time", "process crashes", "archive cut short", "FMI 1"])
def test_the_command_names_what_it_finds_and_ends_with_1(
    name: str, built: dict[str, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = BY_NAME[name].write(built["QuadrotorPlant"], tmp_path)
    with pytest.raises(SystemExit) as end:
        cli.main(["validate", str(path)])
    assert end.value.code == 1
    first, *lines = capsys.readouterr().out.splitlines()
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
    first, second = json.loads(capsys.readouterr().out)
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


@pytest.mark.parametrize("model", MODELS)
def test_the_checkers_of_others_find_nothing_wrong_with_the_fmus(model: str, built: dict[str, Path]) -> None:
    assert fmpy_finds(built[model]) == []
    assert fmutool_finds(built[model]) == []


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
    assert as_markdown(table).splitlines() == [
        "| damage | found by the rule | fmpy validate | fmutool -check |",
        "|---|---|---|---|",
        "| name twice | `standard` | yes | yes |",
        "| empty GUID | `guid` | - | - |",
        "| description not XML | `readable` | yes | yes |",
    ]
