"""`quadcosim schedule`: its table, its document, its figure."""

import json
from dataclasses import replace
from pathlib import Path

import pytest

from orchestration.foundation.basics.errors import UsageError
from orchestration.foundation.recording.recording import InMemory
from orchestration.simulation.figures import gantt
from orchestration.simulation.figures.drawn_run import DrawnRun, Window
from orchestration.simulation.figures.style import SCREEN
from orchestration.simulation.requests.ranges import default_quantity
from orchestration.systems.computers.timeline import Timeline
from orchestration.systems.system.file import load_system
from orchestration.systems.system.model import System
from quadcosim import schedule
from tests.commands import Main
from tests.places import EXAMPLES

SYSTEM = Path(__file__).with_name("test_schedule.toml").read_text(encoding="utf-8")


def run_of(system: System, window: Window | None = None) -> DrawnRun:
    """A run as figures see it, of which nothing was recorded."""
    recording = InMemory().finish()
    return DrawnRun(
        name="", place=0, title="", system=system, recording=recording, whole=recording, described={}, parameters={},
        window=window,
    )  # fmt: skip


@pytest.fixture
def file(tmp_path: Path) -> Path:
    """A file of computers and networks alone, without an end."""
    path = tmp_path / "system.toml"
    path.write_text(SYSTEM)
    return path


def test_the_document_has_each_task_and_message_by_the_names_that_are_fixed(main: Main, file: Path) -> None:
    document = json.loads(main("schedule", str(file), "--until", "0.1", "--json").stdout)
    assert [*document["tasks"], *document["messages"]] == ["cpu.control", "cpu.telemetry", "bus.status"]
    control = document["tasks"]["cpu.control"]
    assert {"jobs", "utilisation", "response", "bound", "missed", "unfinished"} <= control.keys()
    assert control["response"] == dict.fromkeys(("min", "mean", "p99", "max"), 0.0011)
    assert (control["jobs"], control["utilisation"], control["bound"]) == (25, 0.25, 0.0011)
    assert document["tasks"]["cpu.telemetry"]["bound"] is None
    assert document["messages"]["bus.status"]["bound"] is None


def test_the_table_has_a_row_for_each_and_marks_unknown_values(main: Main, file: Path) -> None:
    answer, *lines = main("schedule", str(file), "--until", "0.1").stdout.splitlines()
    assert answer == "deadlines missed in 100 ms: cpu.telemetry 100 %; cpu busy 100 %"
    cells = lines[0].split()
    assert cells[0] == "task"
    assert "bound" in cells
    assert lines[1].split()[:3] == ["cpu.control", "25", "25"]
    assert " -  " in lines[2]
    assert any(line.startswith("bus.status") for line in lines)
    assert any(line.startswith("cpu: busy 100 % of 0.1 s") for line in lines)


@pytest.mark.parametrize(
    ("flags", "message"),
    [
        ((), "stop_time: expected a value"),
        (("--until", "0"), "--until 0: expected a positive number of seconds"),
        (("--until", "1", "--out", "a.txt"), "--out a.txt: expected a figure ending in one of png, svg, pdf"),
        (("--until", "1", "--out", "a.png", "--from", "2"), "expected 0 <= from < to, and from before the end at 1 s"),
    ],
)
def test_what_cannot_be_is_refused(main: Main, file: Path, flags: tuple[str, ...], message: str) -> None:
    done = main("schedule", str(file), *flags, code=2)
    assert message in done.stderr


def test_the_chart_is_written_where_it_is_asked_for(main: Main, file: Path) -> None:
    out = file.parent / "chart.svg"
    done = main("schedule", str(file), "--until", "0.1", "--out", str(out), "--from", "0.01", "--to", "0.05")
    assert str(out) in done.stderr
    text = out.read_text()
    assert all(f">{word}<" in text for word in ("control", "telemetry", "status", "switch", "sent again", "time [ms]"))


def test_a_chart_shows_no_more_than_can_be_told_apart(file: Path) -> None:
    timeline: Timeline = schedule(file, 30.0).timeline
    end = gantt.default_window(timeline)[1]
    assert max((each.begin < end * 1e9).sum() for each in timeline.processors.values()) == gantt.PIECES
    assert gantt.default_window(schedule(file, 0.01).timeline) == (0.0, 0.01)
    with SCREEN.applied():
        shown = gantt.draw(schedule(file, 0.1).timeline, SCREEN, (0.0, 10.0)).legends[0].get_texts()
    assert "switch" not in [text.get_text() for text in shown]  # too short to be seen there


def test_a_chart_has_a_panel_for_each_processor_and_link_and_bars_as_long_as_they_run(file: Path) -> None:
    found = schedule(file, 0.02)
    with SCREEN.applied():
        figure = gantt.draw(found.timeline, SCREEN)
    cpu, bus = figure.axes
    assert [axes.get_title(loc="left") for axes in (cpu, bus)] == ["cpu", "bus"]
    assert [label.get_text() for label in cpu.get_yticklabels()] == ["control", "telemetry"]
    bars = cpu.collections[1].get_paths()  # of the first task, behind those that wait
    assert [round(path.get_extents().width, 6) for path in bars] == [1.0] * 5
    assert [round(path.get_extents().x0, 6) for path in bars] == [0.1, 4.1, 8.1, 12.1, 16.1]


def test_a_run_of_a_system_without_computers_has_no_chart() -> None:
    of = load_system(EXAMPLES / "water_tank" / "system.toml")
    assert gantt.chart([run_of(of)], SCREEN) is None


def test_a_chart_of_a_run_is_of_its_window() -> None:
    of = replace(load_system(EXAMPLES / "three_servos" / "can.toml"), stop_time=0.1)
    figure = gantt.chart([run_of(of, window=(0.02, 0.04))], SCREEN)
    assert figure is not None
    assert {axes.get_xlim() for axes in figure.axes} == {(20.0, 40.0)}
    assert gantt.chart([run_of(of), run_of(of)], SCREEN) is None


def test_values_of_the_system_are_changed_by_their_paths(main: Main, file: Path) -> None:
    changes = ("--set", "computers.cpu.tasks.telemetry.execution=0.002", "--set", "computers.cpu.switch=0")
    found = json.loads(main("schedule", file, "--until", "1", "--json", *changes).stdout)["tasks"]["cpu.telemetry"]
    assert found["response"]["max"] == 0.003
    line = main("schedule", file, "--until", "1", "--set", "computers.cpu.switch=1e300", code=2).stderr
    assert line == "quadcosim: computers.cpu.switch = 1e+300 s: expected less than 1.15292e+09 s\n"


def test_the_period_of_a_task_that_messages_release_is_no_usual_quantity() -> None:
    with pytest.raises(UsageError, match=r"of: expected a path, as connections\.NAME\.delay$"):
        default_quantity(load_system(EXAMPLES / "three_servos" / "can.toml"))
