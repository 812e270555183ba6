"""The text for a GPU, played by a processor thread after thread, has the bits of lanes of vector registers."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import pytest

from orchestration.engines.batch import batch
from orchestration.engines.batch.batch import NOTHING, Batch, BatchResult
from orchestration.engines.batch.shape import Shape
from orchestration.engines.cuda import driver, fleet
from orchestration.engines.cuda.driver import Gpu
from orchestration.engines.cuda.fleet import Fleet
from orchestration.engines.structures import structures
from orchestration.quadrotor.scenario import Scenario
from orchestration.quadrotor.timing import Timing
from orchestration.schedule import schedule_cache
from orchestration.schedule.schedule_cache import ScheduleCache, timing
from orchestration.system.model import Criterion, System
from orchestration.system.paths import changed
from orchestration.system.system_file import load_system
from tests.orchestration.engines.batch.lanes import located, shape_of
from tests.orchestration.engines.batch.test_batches import F
from tests.orchestration.engines.cuda import playing
from tests.orchestration.fmi.small import needs_compiler

pytestmark = needs_compiler


c = structures(1)
EXAMPLE = Path(__file__).parents[4] / "examples" / "four_components" / "system.toml"
X, MASS, INERTIA = (f"components.plant.parameters.{name}" for name in ("initial.position.x", "mass", "inertia.xx"))
NOISE = {"position": 0.01, "velocity": 0.02}
LATE = Timing(jitter=0.004, delay=0.003, measurement_loss=0.2, command_loss=0.1, noise=NOISE)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    there = tmp_path_factory.mktemp("processor")
    playing.make_driver(there)
    return there


@pytest.fixture
def gpu(folder: Path, monkeypatch: pytest.MonkeyPatch) -> Gpu:
    monkeypatch.setattr(driver, "LIBRARY", str(folder / playing.DRIVER))
    monkeypatch.setattr(fleet, "compiled", lambda text, architecture: playing.played(text, folder))
    monkeypatch.setattr(batch, "MOST_ROWS", 2**10)
    return Gpu()


@pytest.fixture(scope="module")
def late() -> System:
    return located(Scenario(timing=LATE, stop_time=0.3).as_system())


def assert_the_same(shape: Shape, crowd: Sequence[System], gpu: Gpu, *, count: int) -> list[BatchResult]:
    """In lanes and by threads, in groups of `count`."""
    groups = [crowd[i : i + count] for i in range(0, len(crowd), count)]
    given = [(group, [timing(system) for system in group], NOTHING) for group in groups]
    columns = shape.board.columns[1:]
    threads = [found for _, found in Fleet(shape, ScheduleCache(), gpu).run(given, columns)]
    lanes = Batch(shape, ScheduleCache())
    for own, by_threads in zip(given, threads):
        by_lanes = lanes.run(*own[:2], columns)
        for name in ("outcome", "time", "component", "steps", "doubtful"):
            assert getattr(by_threads, name).tolist() == getattr(by_lanes, name).tolist(), name
        whole = by_lanes.outcome == c.RUNNING  # what has ended before has no objectives
        for call, values in by_lanes.reductions.items():
            assert by_threads.reductions[call][whole].tobytes() == values[whole].tobytes(), call
        assert [rows.tobytes() for rows in by_threads.signals] == [rows.tobytes() for rows in by_lanes.signals]
    return threads


def test_flights_with_jitter_losses_and_noise_are_the_same(gpu: Gpu, late: System) -> None:
    shape = shape_of(late)
    crowd = [replace(late, seed=seed) for seed in range(shape.lanes + 3)]
    assert_the_same(shape, crowd, gpu, count=shape.lanes)


def test_windows_room_that_is_too_small_and_flights_of_one_timing(
    gpu: Gpu, late: System, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(schedule_cache, "INSTANTS", 70)  # of a span
    monkeypatch.setattr(fleet, "_MESSAGES", 1)
    monkeypatch.setattr(fleet, "_VALUES", 1)
    crowd = [
        changed(late, {"stop_time": 0.2, "components.controller.sampling.period": period, MASS: mass})
        for period, mass in ((0.01, 1.0), (0.02, 1.5), (0.01, 1.2))
    ]
    assert_the_same(shape_of(late), [replace(each, seed=1) for each in crowd], gpu, count=2)


def test_each_flight_ends_by_itself_in_any_way(gpu: Gpu, late: System) -> None:
    crowd = [late, *(changed(late, start) for start in ({X: 900.0}, {X: 1e200}, {INERTIA: 1e-300}))]
    found = assert_the_same(shape_of(late), crowd, gpu, count=3)
    outcomes = [int(outcome) for each in found for outcome in each.outcome]
    assert outcomes == [c.RUNNING, c.DIVERGED, c.REFUSED, c.FAILED]


def test_connections_of_every_kind_and_every_function(gpu: Gpu) -> None:
    cruise = located(replace(load_system(EXAMPLE), stop_time=3.0))
    connections = tuple(replace(x, hold="first") if x.name == "force" else x for x in cruise.connections)
    signals = ("car.speed", "engine.force", "car.force", "sampled(demand, controller.force)")
    texts = [function.format(x) for x in signals for function in F if not (x[0] == "s" and "share({}" in function)]
    cruise = replace(cruise, connections=connections, objectives={f"x{i}": text for i, text in enumerate(texts)})
    cruise = replace(cruise, criterion=Criterion())
    assert_the_same(shape_of(cruise), [replace(cruise, seed=seed) for seed in (1, 2, 3)], gpu, count=3)
