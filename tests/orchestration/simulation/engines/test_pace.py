"""A run with a pace waits for its instants, skips none, says how late it was, and has the same bits."""

from pathlib import Path
from typing import Any

import pytest

from orchestration.simulation.engines.running_system import LONGEST_SLEEP, Pace
from orchestration.simulation.runs import simulation
from orchestration.simulation.runs.simulation import simulate
from quadcosim import Component, System
from tests.commands import Main
from tests.native import NATIVE


class Clock:
    """A clock on the wall that goes on by what is slept, and by what is worked before each look at it."""

    def __init__(self, work: float = 0.0) -> None:
        self.time, self.work, self.slept = 100.0, work, list[float]()

    def now(self) -> float:
        self.time += self.work
        return self.time

    def sleep(self, duration: float) -> None:
        self.slept.append(duration)
        self.time += duration


def never() -> bool:
    return False


def test_an_instant_begins_at_its_time_and_a_late_one_at_once() -> None:
    clock = Clock()
    pace = Pace(2.0, clock.now, clock.sleep)
    begins = []
    for instant, work in ((0, 0.0), (100_000_000, 0.5), (200_000_000, 0.0), (1_400_000_000, 0.0)):
        pace.wait(instant, never)
        begins.append(round(clock.time - 100.0, 9))
        clock.time += work
    assert begins == [0.0, 0.05, 0.55, 0.7]
    assert pace.largest_lateness == pytest.approx(0.55 - 0.1)
    assert max(clock.slept) <= LONGEST_SLEEP


def test_an_interruption_ends_the_wait() -> None:
    clock = Clock()
    pace = Pace(1.0, clock.now, clock.sleep)
    pace.wait(0, never)
    pace.wait(10**12, lambda: len(clock.slept) >= 3)
    assert len(clock.slept) == 3
    assert pace.largest_lateness == 0.0


@pytest.mark.parametrize("engine", ["python", "compiled"])
def test_a_run_with_a_pace_has_the_same_rows_and_takes_as_long_as_it_lasts(
    engine: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    what, clock = NATIVE.with_changes(stop_time=0.05), Clock()
    free = simulate(what, engine=engine)
    monkeypatch.setattr(simulation, "Pace", lambda rate: Pace(rate, clock.now, clock.sleep))
    paced = simulate(what, engine=engine, pace=0.5)
    assert free is not None
    assert paced is not None
    assert paced.rows.tobytes() == free.rows.tobytes()
    assert paced.metrics == free.metrics
    assert clock.time - 100.0 == pytest.approx(0.1)
    assert len(clock.slept) == len(free.rows) - 1
    assert paced.provenance["largest_lateness"] == pytest.approx(0.0, abs=1e-12)
    assert "largest_lateness" not in free.provenance


def test_the_largest_lateness_is_printed(main: Main, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    clock = Clock(work=0.25)
    monkeypatch.setattr(simulation, "Pace", lambda rate: Pace(rate, clock.now, clock.sleep))
    file = tmp_path / "system.toml"
    plant = Component(fmu="native/QuadrotorPlant", step=0.01)
    file.write_text(System(stop_time=0.02, components={"plant": plant}).to_toml())
    printed = main("run", file, "--pace", "1").stdout
    assert "largest_lateness  0.73 s" in printed
    assert "--pace 0: expected a positive number" in main("run", file, "--pace", "0", code=2).stderr
