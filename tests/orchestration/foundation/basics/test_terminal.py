"""Progress of long work: a bar on a terminal, occasional lines where none can be drawn."""

import io
import re
import sys
import threading
import time
from collections.abc import Callable
from queue import SimpleQueue

import pytest

from orchestration.foundation.basics import terminal
from orchestration.foundation.basics.terminal import SPARSE, progress_bar, runs_bar, stated_beside_bar


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


@pytest.fixture
def wait(monkeypatch: pytest.MonkeyPatch) -> Callable[[float], None]:
    """Advances the clock of the progress lines."""
    now = [100.0]
    monkeypatch.setattr(time, "monotonic", lambda: now[0])

    def passes(seconds: float) -> None:
        now[0] += seconds

    return passes


@pytest.mark.parametrize(("kind", "steady"), [("pipe", True), ("dumb terminal", True), ("pipe", False)])
def test_where_no_bar_can_be_drawn_occasional_lines_show_the_time_left(
    kind: str, steady: bool, wait: Callable[[float], None], monkeypatch: pytest.MonkeyPatch
) -> None:
    output = io.StringIO() if kind == "pipe" else Terminal()
    monkeypatch.setattr(sys, "stderr", output)
    monkeypatch.setenv("TERM", "dumb")
    with progress_bar("flying", steady=steady) as progress:
        for percent in range(101):
            wait(SPARSE / 40)
            progress(percent / 100)
    left = (", 16 s left", ", 5 s left") if steady else ("", "")
    assert output.getvalue().splitlines() == [f"flying: 39%{left[0]}", f"flying: 79%{left[1]}"]


def test_occasional_lines_count_runs_too(
    wait: Callable[[float], None], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    with runs_bar() as progress:
        for done in range(4):
            wait(0.6 * SPARSE)
            progress(done, 50)
    assert capsys.readouterr().err.splitlines() == ["1 of 50 runs, 10 min left", "3 of 50 runs, 6 min left"]


def test_long_work_that_tells_no_share_says_that_it_goes_on_and_what_it_does(monkeypatch: pytest.MonkeyPatch) -> None:
    said: SimpleQueue[str] = SimpleQueue()
    monkeypatch.setattr(terminal, "SILENCE", 0.05)
    monkeypatch.setattr(terminal, "inform", said.put)
    with progress_bar("certifying") as progress, stated_beside_bar("linear model of plant"):
        progress(0.25)
        assert re.fullmatch(r"certifying: 25%, linear model of plant, \d+ s so far", said.get(timeout=60.0))
    assert all(each.name != "progress" for each in threading.enumerate())


def test_short_work_prints_nothing(capsys: pytest.CaptureFixture[str]) -> None:
    with progress_bar("flying") as progress:
        progress(0.5)
        progress(1.0)
    assert capsys.readouterr().err == ""


def test_on_a_terminal_there_is_a_bar_without_colours_too(monkeypatch: pytest.MonkeyPatch) -> None:
    output = Terminal()
    monkeypatch.setattr(sys, "stderr", output)
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setenv("NO_COLOR", "1")
    with progress_bar("flying") as progress:
        progress(0.5)
    assert "50%" in output.getvalue()
    assert terminal._draws()
