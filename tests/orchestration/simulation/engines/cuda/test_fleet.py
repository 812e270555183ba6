"""The CUDA text, executed by a CPU thread after thread, has the bits of SIMD lanes."""

import re
from collections.abc import Sequence
from dataclasses import replace

import pytest

from orchestration.components.fmi.model import Model
from orchestration.foundation.basics.errors import QuadcosimError
from orchestration.quadrotor.scenarios.fmu_choice import FmuChoice
from orchestration.quadrotor.scenarios.scenario import Scenario
from orchestration.quadrotor.scenarios.timing import Timing
from orchestration.simulation.engines.batch import batch
from orchestration.simulation.engines.batch.batch import Batch, BatchResult
from orchestration.simulation.engines.batch.shape import Shape
from orchestration.simulation.engines.cuda import fleet
from orchestration.simulation.engines.cuda.driver import Gpu
from orchestration.simulation.engines.cuda.fleet import Fleet, expect_gpu
from orchestration.simulation.engines.cuda.program import Code
from orchestration.simulation.engines.structures import structures
from orchestration.systems.schedule import schedule_cache
from orchestration.systems.schedule.schedule_cache import ScheduleCache
from orchestration.systems.system.criterion import Criterion
from orchestration.systems.system.file import load_system
from orchestration.systems.system.model import System
from orchestration.systems.system.paths import changed
from tests.orchestration.components.fmi.small import needs_compiler
from tests.orchestration.simulation.engines.batch.lanes import group_of, located, shape_of
from tests.orchestration.simulation.engines.batch.test_batches import F
from tests.places import EXAMPLES

pytestmark = needs_compiler


c = structures(1)
EXAMPLE = EXAMPLES / "four_components" / "system.toml"
X, MASS, INERTIA = (f"components.plant.parameters.{name}" for name in ("initial.position.x", "mass", "inertia.xx"))
PERIOD = "components.controller.sampling.period"
NOISE = {"position": 0.01, "velocity": 0.02}
LATE = Timing(jitter=0.004, delay=0.003, measurement_loss=0.2, command_loss=0.1, noise=NOISE)


def assert_the_same(
    fleet_: Fleet, shape: Shape, crowd: Sequence[System], *, count: int | None = None
) -> list[BatchResult]:
    """The results in threads and in lanes, in groups of `count`."""
    groups = [crowd[i : i + (count or len(crowd))] for i in range(0, len(crowd), count or len(crowd))]
    groups_of_runs = [*map(group_of, groups)]
    columns = shape.board.columns[1:]
    threads = [found for _, found in fleet_.run(groups_of_runs, columns)]
    lanes = Batch(shape, ScheduleCache())
    for own, by_threads in zip(groups_of_runs, threads):
        by_lanes = lanes.run(own, columns)
        for name in ("outcome", "time", "component", "steps", "doubtful"):
            assert getattr(by_threads, name).tolist() == getattr(by_lanes, name).tolist(), name
        whole = by_lanes.outcome == c.RUNNING  # runs that ended early have no objectives
        for call, values in by_lanes.reductions.items():
            assert by_threads.reductions[call][whole].tobytes() == values[whole].tobytes(), call
        assert [rows.tobytes() for rows in by_threads.signals] == [rows.tobytes() for rows in by_lanes.signals]
    return threads


def test_flights_of_any_timing_that_end_in_any_way(gpu: Gpu, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(schedule_cache, "INSTANTS", 70)  # of a span
    monkeypatch.setattr(fleet, "_MESSAGES", 1)
    monkeypatch.setattr(fleet, "_VALUES", 1)
    law = FmuChoice(fmu="CascadedController")  # leaves its straight line now and then
    late = located(Scenario(controller=law, timing=LATE, stop_time=0.2).as_system())
    shape = shape_of(late)
    ends = [{X: 900.0}, {INERTIA: 1e-300}, {PERIOD: 0.02, MASS: 2.0}, {"stop_time": 0.1}]
    crowd = [*(replace(late, seed=seed) for seed in range(shape.lanes)), *(changed(late, each) for each in ends)]
    found = assert_the_same(Fleet(shape, ScheduleCache(), gpu), shape, crowd, count=shape.lanes)
    outcomes = [int(outcome) for each in found for outcome in each.outcome][shape.lanes :]
    assert outcomes == [c.DIVERGED, c.FAILED, c.RUNNING, c.RUNNING]


def test_a_gpu_has_the_bits_of_lanes(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(batch, "MOST_ROWS", 2**12)
    try:
        expect_gpu()
    except QuadcosimError as error:
        pytest.skip(str(error))
    late = located(Scenario(timing=LATE, stop_time=1.0).as_system())
    shape = shape_of(late)
    crowd = [changed(late, {"seed": seed, MASS: 1.0 + seed / 1000}) for seed in range(40 * shape.lanes + 1)]
    assert_the_same(Fleet(shape, ScheduleCache(), Gpu()), shape, crowd, count=shape.lanes)


def test_connections_of_every_kind_and_every_function_with_numbers_that_are_no_longer_constants(gpu: Gpu) -> None:
    cruise = located(replace(load_system(EXAMPLE), stop_time=3.0))
    connections = tuple(replace(x, hold="first") if x.name == "force" else x for x in cruise.connections)
    signals = ("car.speed", "engine.force", "car.force", "sampled(demand, controller.force)")
    texts = [function.format(x) for x in signals for function in F if not (x[0] == "s" and "share({}" in function)]
    cruise = replace(cruise, connections=connections, objectives={f"x{i}": text for i, text in enumerate(texts)})
    cruise = replace(cruise, criterion=Criterion())
    shape = shape_of(cruise)
    one = Fleet(shape, ScheduleCache(), gpu)
    crowd = [replace(cruise, seed=seed) for seed in (1, 2)]
    assert_the_same(one, shape, crowd)
    assert_the_same(one, shape, [changed(each, {"components.car.parameters.mass": 1500.0}) for each in crowd])


def test_a_run_fails_in_its_thread_where_a_constant_has_changed(gpu: Gpu, monkeypatch: pytest.MonkeyPatch) -> None:
    read = Code.of
    begin, line = re.compile(r"(static q_mask model_do_step\(.*\)\n\{\n)"), re.compile(r"#define STRAIGHT_STEP .*\n")

    def changing(name: str, model: Model) -> Code:
        code = read(name, model)
        if name != "car":
            return code
        return replace(
            code, functions=line.sub("", begin.sub(r"\1    v[AT_MASS] = v[AT_MASS] + 1.0;\n", code.functions))
        )

    monkeypatch.setattr(Code, "of", changing)
    cruise = replace(located(load_system(EXAMPLE)), stop_time=1.0, objectives={}, criterion=Criterion())
    shape = shape_of(cruise)
    ((_, found),) = Fleet(shape, ScheduleCache(), gpu).run([group_of([cruise])])
    assert (found.outcome.tolist(), found.component.tolist()) == ([c.FAILED], [shape.names.index("car")])
