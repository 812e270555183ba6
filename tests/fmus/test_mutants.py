"""Validation bites: every way to damage an FMU is found, by the rule that is meant for it."""

import functools
import json
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from orchestration.building.models import MODELS
from orchestration.checks.validation import Finding, description, rules, validate
from orchestration.checks.validation.confined_process import PLATFORM, READABLE, look
from orchestration.checks.validation.finding import name_of
from orchestration.checks.validation.progress import Report, Told
from orchestration.checks.validation.validator import PROCESS
from orchestration.command import cli
from orchestration.processes.limits import Limits
from tests.fmus.damage import Mutant
from tests.fmus.mutants import MUTANTS
from tests.fmus.verdicts import as_markdown, fmpy_finds, fmutool_finds, verdicts

BY_NAME = {mutant.name: mutant for mutant in MUTANTS}

Findings = Callable[[Mutant], list[Finding]]
Make = Callable[[str], Path]


STATIC: list[Callable[..., object]] = [*rules.OF_ARCHIVES, description.standard, *rules.OF_DESCRIPTIONS]
WITHOUT_INSTANCES = {READABLE, *map(name_of, [*STATIC, *rules.OUR_DESCRIPTIONS])}
"""Rules that look at the archive and the description: for their mutants nothing needs to run"""


@pytest.fixture(scope="module")
def findings(built: dict[str, Path], tmp_path_factory: pytest.TempPathFactory) -> Iterator[Findings]:
    """What is found wrong with each mutant; of those that run two are under way at a time, each in its process."""
    folder = tmp_path_factory.mktemp("mutants")

    def found(mutant: Mutant) -> list[Finding]:
        return validate(mutant.write(built[mutant.model], folder), limits=Limits(time=mutant.time_limit))

    @functools.cache
    def seen(mutant: Mutant) -> list[Finding]:
        told = Told()
        look(mutant.write(built[mutant.model], folder), Limits().size, Report(told.hear))
        return told.findings

    with ThreadPoolExecutor(2) as pool:
        under_way = {m: pool.submit(found, m) for m in MUTANTS if m.rule not in WITHOUT_INSTANCES}
        yield lambda m: under_way[m].result() if m in under_way else seen(m)
        pool.shutdown(cancel_futures=True)


@pytest.fixture
def make(built: dict[str, Path], tmp_path: Path) -> Make:
    """Makes the mutant of a name."""
    return lambda name: BY_NAME[name].write(built[BY_NAME[name].model], tmp_path)


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
    "name", ["start not a number", "name twice", "GUID of another content", "unit without base units"]
)
def test_what_a_look_finds_the_whole_validation_finds_too(name: str, make: Make, findings: Findings) -> None:
    whole = validate(make(name))
    assert whole[: len(findings(BY_NAME[name]))] == findings(BY_NAME[name])


# -- on the command line --------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["date in local time", "process crashes", "archive cut short", "FMI 3"])
def test_the_command_names_what_it_finds_and_ends_with_1(
    name: str, make: Make, capsys: pytest.CaptureFixture[str]
) -> None:
    path = make(name)
    with pytest.raises(SystemExit) as end:
        cli.main(["validate", str(path)])
    assert end.value.code == 1
    first, *lines = capsys.readouterr().out.splitlines()
    assert first == f"{path}: {len(lines)} problem{'s' if len(lines) > 1 else ''}"
    assert any(line.startswith(f"  {BY_NAME[name].rule}: ") for line in lines)
    assert all(line.startswith("  ") for line in lines)


def test_the_command_gives_findings_as_json(
    make: Make, built: dict[str, Path], capsys: pytest.CaptureFixture[str]
) -> None:
    damaged, sound = make("needs a tool"), built["QuadrotorPlant"]
    with pytest.raises(SystemExit) as end:
        cli.main(["validate", "--json", str(damaged), str(sound)])
    assert end.value.code == 1
    first, second = json.loads(capsys.readouterr().out)
    assert first["fmu"] == str(damaged)
    text = "needsExecutionTool = true: expected false"
    assert {"rule": "execution-tool", "text": text, "note": False} in first["findings"]
    assert second == {"fmu": str(sound), "findings": []}


def test_the_command_stops_an_fmu_at_the_time_limit(make: Make, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as end:
        cli.main(["validate", "--time-limit", "2", str(make("step without end"))])
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


def test_the_table_says_who_notices_what(built: dict[str, Path], tmp_path: Path) -> None:
    chosen = [BY_NAME[name] for name in ("name twice", "empty GUID", "description not XML")]
    table = verdicts(chosen, built, tmp_path)
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
