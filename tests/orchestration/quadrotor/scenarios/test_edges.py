"""The edges of the contract that are easy to lose."""

import math
from pathlib import Path
from typing import Any

import pytest

from orchestration.foundation.basics.errors import UsageError
from orchestration.quadrotor.scenarios.scenario import Scenario
from orchestration.quadrotor.scenarios.timing import Timing
from orchestration.simulation.runs.run_directory import run_folder
from tests.orchestration.quadrotor.scenarios.stubs import Counting, Plant, Straying, StubRun, cursor_of, instants_of


@pytest.mark.parametrize("name", ["velocity__x", "quaternion__w"])
def test_a_measurement_that_is_not_finite_ends_the_run_before_it_is_passed_on(name: str) -> None:
    sudden: dict[str, Any] = {name: math.nan}
    run = StubRun(Timing(), 0.05, Straying(time=0.012, **sudden))
    assert run.master.divergence_time == 12_000_000


def test_a_command_that_is_not_finite_never_reaches_the_plant() -> None:
    class Failing(Counting):
        def advance(self, t: float, h: float) -> None:
            super().advance(t, h)
            self.values["thrust"] = math.nan if t >= 0.01 else 1.0

    run = StubRun(Timing(), 0.05, controller=Failing())
    assert run.master.divergence_time == 10_000_000
    assert all(map(math.isfinite, run.plant.thrusts))


def test_a_start_too_far_away_is_divergence_at_zero() -> None:
    run = StubRun(Timing(), 0.05, Plant({"position.x": 200.0}))
    assert run.master.divergence_time == 0


def test_a_period_of_a_nanosecond_has_instants_that_increase() -> None:
    times = [instant.time for instant in instants_of(cursor_of(Timing(period=1e-9, plant_interval=1e-9), 1e-8))]
    assert times == list(range(11))


def test_changing_an_unknown_key_lists_the_known_ones() -> None:
    with pytest.raises(UsageError, match=r"timing.foo: no such key; expected one of period"):
        Scenario().with_changes(timing={"foo": 1})
    with pytest.raises(UsageError, match=r"foo: no such key; expected one of stop_time"):
        Scenario().with_changes(foo=1)


def test_a_state_that_was_taken_does_not_change_while_the_run_goes_on() -> None:
    first = StubRun(Timing(), 0.05, start=False)
    first.master.initialise()
    first.master.run(pause_at=20_000_000)
    state, saved = first.state()
    first.master.run()
    second = StubRun(Timing(), 0.05, start=False)
    second.master.restore(state, saved)
    second.master.run()
    assert second.bits() == first.bits()


def test_a_folder_with_something_beside_a_run_is_not_replaced(tmp_path: Path) -> None:
    folder = tmp_path / "study"
    folder.mkdir()
    (folder / "scenario.toml").write_text("")
    (folder / "notes.txt").write_text("precious")
    with pytest.raises(UsageError, match="nothing else in it"), run_folder(folder, ("metrics.json",)):
        pass
    assert (folder / "notes.txt").read_text() == "precious"


def test_the_folder_one_is_in_is_not_replaced(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(UsageError, match="another directory"), run_folder(Path()):
        pass
    assert list(tmp_path.parent.glob(f".{tmp_path.name}*")) == []
