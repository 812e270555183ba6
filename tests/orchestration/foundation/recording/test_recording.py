"""Rows and events that go to disk as the flight goes on are those of a flight that is kept in memory."""

from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

import quadcosim
from orchestration.foundation.recording.recording import InMemory, thinned
from orchestration.quadrotor.flight.names import FIGURES as FLIGHT
from orchestration.simulation.engines.master import Engine
from orchestration.simulation.runs import draw as drawn
from orchestration.simulation.runs.draw import draw
from orchestration.simulation.runs.pause import fly_until, resume
from orchestration.simulation.runs.run_directory import keep_run
from quadcosim import Result, Timing, load_run
from tests.native import native

JACOBI = Timing(order="jacobi", delay=0.003, jitter=0.004, command_loss=0.3, hold="first")
SCENARIO = native(stop_time=0.5, timing=JACOBI, seed=5)


@pytest.fixture
def whole() -> Result:
    return quadcosim.run(SCENARIO)


@pytest.fixture(autouse=True)
def _few_rows(whole: Result, monkeypatch: pytest.MonkeyPatch) -> None:
    """In each chunk, once the flight to compare with is over."""
    monkeypatch.setattr("orchestration.simulation.engines.backlog.ROWS", 64)


def expect_equal(found: Result, whole: Result) -> None:
    assert found.columns == whole.columns
    assert found.rows.tobytes() == whole.rows.tobytes()
    assert found.events == whole.events
    assert found.metrics.keys() == whole.metrics.keys()
    for name, value in whole.metrics.items():  # sums over chunks differ in their last bits
        near = pytest.approx(value, rel=1e-12) if isinstance(value, float) else value
        assert found.metrics[name] == near


def test_what_is_on_disk_is_what_was_flown_chunk_by_chunk(whole: Result, tmp_path: Path) -> None:
    keep_run(tmp_path / "run", lambda to: quadcosim.run(SCENARIO, recorder=to), figures=False)
    groups = pq.ParquetFile(tmp_path / "run" / "signals.parquet").metadata
    sizes = [groups.row_group(i).num_rows for i in range(groups.num_row_groups)]
    assert sizes[:-1] == [64] * (len(whole.rows) // 64)
    found = load_run(tmp_path / "run")
    expect_equal(found, whole)
    for chunk, after in zip(found.recording.chunks(), [*list(found.recording.chunks())[1:], None]):
        assert after is None or chunk.events[-1].time <= chunk.rows[-1, 0] * 1e9 < after.events[0].time


@pytest.mark.parametrize("engine", ["python", "compiled"])
def test_a_sample_at_the_last_row_of_a_chunk_is_in_that_chunk_and_counts_once(
    engine: Engine, monkeypatch: pytest.MonkeyPatch
) -> None:
    scenario = native(stop_time=0.3, timing=Timing(offset=0.009))  # at rows 9, 19, 29 and so on
    monkeypatch.setattr("orchestration.simulation.engines.backlog.ROWS", 10**6)
    whole = quadcosim.run(scenario, engine=engine)
    monkeypatch.setattr("orchestration.simulation.engines.backlog.ROWS", 10)
    found = quadcosim.run(scenario, engine=engine)
    chunks = list(found.recording.chunks())
    assert len(chunks) > 20
    assert all(chunk.events[-1].time == round(chunk.rows[-1, 0] * 1e9) for chunk in chunks[:-1])
    expect_equal(found, whole)


def test_many_events_make_a_chunk_whole_too(whole: Result, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("orchestration.simulation.engines.backlog.ROWS", 10**6)
    monkeypatch.setattr("orchestration.simulation.engines.backlog.EVENTS", 20)
    keep_run(tmp_path / "run", lambda to: quadcosim.run(SCENARIO, recorder=to), figures=False)
    found = load_run(tmp_path / "run")
    sizes = [len(chunk.events) for chunk in found.recording.chunks()]
    assert len(sizes) > 5
    assert max(sizes) < 20 + 10
    assert found.rows.tobytes() == whole.rows.tobytes()
    assert found.events == whole.events


def test_rows_are_on_disk_before_the_flight_is_over(tmp_path: Path) -> None:
    sizes: list[int] = []

    def look(share: float) -> None:
        (signals,) = tmp_path.glob(".quadcosim-*.new/partial/run/signals.parquet")
        sizes.append(signals.stat().st_size)

    scenario = SCENARIO.with_changes(stop_time=1.5)
    keep_run(tmp_path / "run", lambda to: quadcosim.run(scenario, recorder=to, progress=look), figures=False)
    assert sizes == sorted(sizes)
    assert len(set(sizes[:-1])) > 1


@pytest.mark.parametrize("at", [0.01, 0.2, 0.4])
def test_a_pause_between_chunks_changes_nothing(at: float, whole: Result, tmp_path: Path) -> None:
    fly_until(SCENARIO, at, tmp_path / "paused")
    expect_equal(resume(tmp_path / "paused", tmp_path / "done", figures=False), whole)
    expect_equal(resume(tmp_path / "paused"), whole)


def test_a_diverged_run_is_the_same_in_chunks(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    scenario = native(stop_time=3.0, timing=Timing(period=0.3, order="jacobi"))
    chunks = quadcosim.run(scenario)
    monkeypatch.setattr("orchestration.simulation.engines.backlog.ROWS", 10**6)
    expect_equal(chunks, quadcosim.run(scenario))


def test_a_long_run_is_drawn_with_fewer_rows_but_all_of_the_window(tmp_path: Path) -> None:
    result = quadcosim.run(SCENARIO)
    few = thinned(result.recording, {"time", "plant.thrust"}, (0.1, 0.2), 100)
    t = np.concatenate([chunk.rows[:, 0] for chunk in few.chunks()])
    inside = (t >= 0.1) & (t <= 0.2)
    whole = result.rows[:, 0]
    assert t[inside].tolist() == whole[(whole >= 0.1) & (whole <= 0.2)].tolist()
    assert 50 < (~inside).sum() < 100
    assert isinstance(few, InMemory)
    events = {event for chunk in few.chunks() for event in chunk.events}
    assert {event for event in result.events if 1e8 <= event.time <= 2e8} <= events < set(result.events)


def test_figures_of_a_long_run_are_drawn(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(drawn, "MAX_ROWS_OUTSIDE", 100)
    assert set(draw(quadcosim.run(SCENARIO))) == set(FLIGHT)
