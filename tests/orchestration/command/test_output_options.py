"""What every command has and does, whatever it is about."""

import inspect
import json
import logging
import os
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from orchestration.command.cli import command_line
from orchestration.command.registry import CommandResult
from orchestration.foundation.basics.terminal import configure
from tests.commands import Main
from tests.places import ROOT

GROUP: Any = command_line()
COMMANDS = sorted(GROUP.commands)
SHORT = ("run", "--native", "--stop-time", "0.01")
STUDY = """
name = "one"
[base]
stop_time = 0.01
[[axes]]
name = "period"
sets = ["timing.period"]
values = [0.01]
"""


@pytest.fixture(autouse=True)
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A folder of its own; afterwards nothing listens to the files of a test any more."""
    monkeypatch.chdir(tmp_path)
    yield tmp_path
    configure(logging.INFO, None)


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_has_the_same_manners_and_a_group_in_the_help(command: str) -> None:
    of_it = GROUP.commands[command]
    flags = {name for parameter in of_it.params for name in parameter.opts}
    assert {"--json", "--quiet", "-q", "--verbose", "-v", "--log", "--debug"} <= flags
    assert of_it.rich_help_panel in {"Run", "Study", "FMUs", "Other tools"}
    assert inspect.unwrap(of_it.callback).__annotations__["return"] in (CommandResult, "CommandResult")


def test_help_and_the_page_explain_the_same_exit_codes(main: Main) -> None:
    helped = " ".join(main("--help").stdout.split()).partition("Exit codes: ")[2].rstrip(".").split(", ")
    rows = re.findall(r"^\| (\d+) \| (.*) \|$", (ROOT / "docs/commands.md").read_text(encoding="utf-8"), re.MULTILINE)
    assert [code for code, _ in rows] == ["0", "1", "2", "130", "141"]
    for (code, meaning), text in zip(rows, helped, strict=True):
        assert f"{code} {meaning}".startswith(text)


REPORTS = {
    "run": SHORT,
    "show": ("show",),
    "schema": ("schema",),
    "connect": ("connect", "UnifiedController", "QuadrotorPlant"),
    "ssp": ("ssp", "--out", "loop.ssp"),
    "a run that is kept": (*SHORT, "--out", "kept", "--no-figures"),
    "a run that is paused": (*SHORT, "--out", "paused", "--pause-at", "0.005"),
    "the version": ("--version",),
}


@pytest.mark.parametrize("arguments", REPORTS.values(), ids=REPORTS)
def test_with_json_standard_output_is_one_document_and_without_it_is_none(
    arguments: tuple[str, ...], main: Main, here: Path
) -> None:
    document = json.loads(main(*arguments, "--json").stdout)
    assert document
    for path in document.get("files", []):
        assert Path(path).is_file()


def test_a_study_tells_in_json_what_it_flew_how_far_it_is_and_what_it_wrote(main: Main, here: Path) -> None:
    (here / "study.toml").write_text(STUDY)
    swept = json.loads(main("sweep", "study.toml", "--json").stdout)
    assert (swept["total"], swept["flown"], swept["failed"]) == (1, 1, 0)
    told = json.loads(main("--json", "status", "study.toml").stdout)
    assert (told["total"], told["done"], told["missing"], told["path"]) == (1, 1, 0, swept["path"])
    written = json.loads(main("export", "study.toml", "--json").stdout)["files"]
    assert {Path(path).name for path in written} >= {"runs.parquet", "runs.csv"}


@pytest.mark.parametrize("quiet", [("-q", *SHORT), (*SHORT, "--quiet")])
def test_quiet_stands_before_or_after_the_command_and_leaves_results_and_warnings(
    quiet: tuple[str, ...], main: Main
) -> None:
    told, spoken = main(*quiet), main(*SHORT).stderr.splitlines()
    assert "position_rmse" in told.stdout
    assert [line for line in spoken if line.startswith("warning: ")] == told.stderr.splitlines()
    assert len(spoken) > len(told.stderr.splitlines()) > 0


def test_flags_before_a_command_hold_with_those_behind_it(main: Main) -> None:
    assert "--quiet --verbose" in main("-q", "show", "-v", code=2).stderr


def test_verbose_reports_each_step(main: Main) -> None:
    more, usual = (main(*SHORT, *flags).stderr for flags in (["-v"], []))
    assert "UnifiedController.fmu" in more
    assert "UnifiedController.fmu" not in usual


def test_the_log_has_output_and_steps_with_times_and_the_traceback_of_an_error(main: Main, here: Path) -> None:
    main(*SHORT, "--log", "notes/flight.log", "-q")
    main("run", "--preset", "px5", "--log", "notes/flight.log", code=2)
    log = (here / "notes" / "flight.log").read_text()
    assert "position_rmse" in log  # what was printed
    assert "UnifiedController" in log  # what -v would have said
    assert "quadcosim: preset px5: did you mean px4?" in log
    assert "Traceback" in log
    assert all(line[:2] == "20" for line in log.splitlines() if " INFO " in line or " ERROR " in line)


def test_a_log_that_cannot_be_written_is_one_line(main: Main, here: Path) -> None:
    (here / "taken").write_text("")
    (line,) = main("show", "--log", "taken/log", code=1).stderr.splitlines()
    assert line.startswith("quadcosim: ")


@pytest.mark.parametrize(
    ("arguments", "meant"),
    [
        (["rnu"], "'run'"),
        (["run", "--perod", "1"], "--period"),
        (["run", "--controler", "X"], "--controller"),
        (["run", "--vehicle", "crazyfly"], "crazyflie"),
        (["run", "--preset", "px44"], "px4"),
        (["run", "--engine", "pyton"], "python"),
        (["limit", "--of", "dealy"], "delay"),
        (["status", "study.toml", "--stor", "x"], "--store"),
    ],
)
def test_of_what_is_mistyped_the_closest_is_named(arguments: list[str], meant: str, main: Main) -> None:
    (line,) = main(*arguments, code=2).stderr.splitlines()
    assert f"id you mean {meant}?" in line


COMPLETED = {
    "quadcosim li": {"limit", "linearise", "live"},
    "quadcosim run --hold ": {"zero", "first"},
    "quadcosim run --preset ": {"px4", "crazyflie", "betaflight"},
    "quadcosim run --vehicle c": {"crazyflie"},
    "quadcosim run --controller ": {"UnifiedController", "GeometricController", "CascadedController", "mine.fmu"},
    "quadcosim run --engine ": {"python", "compiled"},
    "quadcosim sweep x.toml --engine b": {"batch"},
    "quadcosim interop --tool lib": {"libcosim"},
    "quadcosim run --period ": set(),
}


@pytest.mark.parametrize("typed", COMPLETED)
def test_shells_propose_the_values_that_there_are(
    typed: str, main: Main, here: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (here / "mine.fmu").write_bytes(b"")
    monkeypatch.setenv("_QUADCOSIM_COMPLETE", "complete_bash")
    monkeypatch.setenv("COMP_WORDS", typed)
    monkeypatch.setenv("COMP_CWORD", str(typed.count(" ")))
    assert set(main().stdout.split()) == COMPLETED[typed]


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_there_is_a_script_for_each_shell(shell: str, main: Main, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("typer.completion._get_shell_name", lambda: shell)
    shown = main("--show-completion").stdout
    assert "_QUADCOSIM_COMPLETE" in shown
    monkeypatch.setenv("_QUADCOSIM_COMPLETE", f"source_{shell}")
    assert main().stdout.strip() == shown.strip()


def test_who_stops_reading_gets_no_traceback() -> None:
    reading, writing = os.pipe()
    os.close(reading)
    with os.fdopen(writing, "w") as nobody:
        done = subprocess.run(
            [sys.executable, "-m", "quadcosim", "schema"], stdout=nobody, stderr=subprocess.PIPE, text=True, check=False
        )
    assert (done.returncode, done.stderr) == (141, "")


def test_the_version_names_with_v_what_the_numbers_stand_on(main: Main) -> None:
    assert len(main("--version").stdout.splitlines()) == 1
    more = main("--version", "-v").stdout
    assert all(name in more for name in ("quadcosim", "python", "numpy", "fmpy"))
