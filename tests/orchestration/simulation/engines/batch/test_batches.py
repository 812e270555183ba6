"""Runs in SIMD lanes have the results of the same runs alone: sums to 1e-12, all else to the last bit."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from orchestration.components.building import fmus
from orchestration.foundation.basics.errors import UsageError
from orchestration.quadrotor.scenarios.scenario import Scenario
from orchestration.quadrotor.scenarios.timing import Timing
from orchestration.simulation.engines.batch.batches import Batches
from orchestration.simulation.runs.many_runs import located as with_files
from orchestration.systems.expressions.reductions import REDUCTIONS
from orchestration.systems.schedule import schedule_cache
from orchestration.systems.system.component import Component, Sampling
from orchestration.systems.system.connection import Connection
from orchestration.systems.system.model import Criterion, System
from orchestration.systems.system.paths import changed
from orchestration.systems.system.source import Source
from tests.orchestration.components.fmi.small import needs_compiler, small
from tests.orchestration.simulation.engines.batch.lanes import in_lanes, shape_of
from tests.orchestration.simulation.engines.test_compiled import Kept, of, ran

pytestmark = needs_compiler
SUMS = ("rmse", "iae", "itae", "effort", "variation", "mean", "rms", "integral", "saturation_share", "share_", "near",
        "attitude_error")  # fmt: skip
"""Words in the names of objectives that are sums, or use functions whose last bit depends on the processor, as acos of
numpy"""


def assert_the_same_numbers(found: Mapping[str, Any], alone: Mapping[str, Any]) -> None:
    assert list(found) == list(alone)
    for name, value in alone.items():
        if value is not None and any(word in name for word in SUMS) and not name.startswith("growth"):
            assert found[name] == pytest.approx(value, rel=1e-12, abs=0.0), name
        else:
            assert (name, found[name]) == (name, value)


X = {
    "continuous": "plant.y", "held": "controller.y", "on_a_line": "plant.u1y", "applied": "plant.u2y",
    "mixed": "plant.z * controller.z + 0.3", "vector": "norm(plant.y, controller.z, 2)",
    "measured": "sampled(measured, plant.y - controller.y)", "commanded": "sampled(commanded, controller.y ** 2)",
}  # fmt: skip
F = ("max({})", "min({})", "mean({})", "rms({})", "integral({})", "last({})", "first({})", "peak_time({})",
     "settling_time({}, 0.7)", "total_variation({})", "share({} > 0.2)", "growth_share({}, 0.1)")  # fmt: skip
MORE = {
    "near_functions": "max(sqrt(abs(plant.y)) + exp(plant.y) * log(2 + plant.z) - sin(plant.y) / cos(plant.z))",
    "near_more_functions": "max(tan(plant.y) + asin(plant.y / 2) - acos(plant.z / 2) + atan2(plant.y, 2))",
    "near_tanh": "max(tanh(plant.z))",
    "near_logic": "share(plant.y > 0 and not (controller.y < 0.1 or time >= stop_time / 2))",
    "choice": "max(min(plant.y, controller.y, 0.4) ** 3)",
    "near_power": "max((plant.y + 3) ** 1.5)",
    "parameters": "last(plant.y) + plant.place * controller.place",
    "never": "settling_time(plant.y, 1e-9)",
    "near_two_passes": "settling_time(plant.y - last(plant.y), 0.5 * max(abs(plant.y)))",
    "near_three_passes": "max(plant.y - mean(abs(plant.y - mean(plant.y))))",
    "near_driven": "rms(plant.y - table.u4y) + integral(noise.u5y ** 2) + max(one.u6y)",
    "combination": "last(plant.y) / max(plant.y) - peak_time(plant.z)",
}
LOOP = System(
    stop_time=1.0,
    components={
        "plant": Component(fmu="stub", step=0.01),
        "controller": Component(fmu="stub", sampling=Sampling(period=0.02, jitter=0.01)),
    },
    connections=(
        Connection(name="measured", start=("plant.y",), end=("controller.u0y",), noise={"y": 0.1}, loss=0.2),
        Connection(name="commanded", start=("controller.y",), end=("plant.u1y",), hold="first", delay=0.03),
        Connection(name="applied", start=("controller.z",), end=("plant.u2y",), delay_jitter=0.01),
    ),
)


def objectives() -> dict[str, str]:
    """Every function of every kind of signal."""
    every = {}
    for kind, x in X.items():
        for function in F:
            name = function.partition("(")[0]
            text = function.format(x)
            if x.startswith("sampled") and name == "share":
                text = f"share({x[:-1]} > 0.2))"
            every[f"{name}_{kind}"] = text
    return {**every, **MORE}


def test_every_reduction_is_compared_with_a_run_alone() -> None:
    tested = {function.partition("(")[0] for function in F}
    assert tested == set(REDUCTIONS)


def test_every_function_over_every_kind_of_signal(fmu: Path, kept: Kept, tmp_path: Path) -> None:
    table = tmp_path / "table.csv"
    table.write_text("time,u4y,u4z\n0,0.1,0.3\n0.37,1,7\n1,-2,0.7\n", encoding="utf-8")
    sources = {
        "table": Source(file=table, to=("plant.u4y", "controller.u4z")),
        "noise": Source(noise=0.01, period=0.007, to=("plant.u5y", "plant.u5z")),
        "one": Source(constant=0.3, to=("controller.u6y",)),
    }
    first = replace(of(LOOP, fmu), sources=sources, objectives=objectives(), criterion=Criterion(good="max_held > 0"))
    crowd = [replace(first, seed=seed) for seed in range(3)] + [
        changed(first, {"components.controller.sampling.period": 0.03, "stop_time": 0.7}),
        changed(first, {"components.plant.parameters.place": 2.0, "sources.one.constant": 0.7}),
    ]
    batches = Batches()
    for what, found in zip(crowd, batches.run(crowd)):
        assert found is not None
        assert batches.run([what]) == [found]
        alone = ran(what, "compiled", load=kept.load).metrics
        assert_the_same_numbers(found.metrics, alone)


def test_held_signals_are_not_reduced_again_where_nothing_but_a_step_happens(fmu: Path, kept: Kept) -> None:
    values = ("controller.y", "plant.u2y", "noise.u4z", "controller.z * noise.u4z - plant.u2y")
    connections = tuple(replace(x, hold="zero") for x in LOOP.connections)
    for to in ("controller.u4z", "plant.u4z"):
        first = replace(
            of(replace(LOOP, connections=connections, stop_time=0.5), fmu),
            sources={"noise": Source(noise=0.01, period=0.007, to=(to,))},
            objectives={f"{f.partition('(')[0]}_{i}": f.format(x) for i, x in enumerate(values) for f in F},
        )
        crowd = [replace(first, seed=seed) for seed in range(3)]
        for what, found in zip(crowd, Batches().run(crowd)):
            assert found is not None
            assert_the_same_numbers(found.metrics, ran(what, "compiled", load=kept.load).metrics)


def test_runs_follow_sources_of_their_own_whatever_parameter_differs(fmu: Path, kept: Kept) -> None:
    parameters = dict.fromkeys(("duration", "dx", "dy", "dz", "start", "x", "y", "z"), 0.5)
    first = replace(
        of(LOOP, fmu),
        sources={"reference": Source(signal="step", parameters=parameters)},
        objectives={f"highest_{axis}": f"max(reference.position.{axis})" for axis in "xyz"},
    )
    crowd = [changed(first, {f"sources.reference.parameters.{name}": 2.0}) for name in parameters]
    for what, found in zip(crowd, Batches().run(crowd)):
        assert found is not None
        assert found.metrics == ran(what, "compiled", load=kept.load).metrics


CONDITIONS = ("plant.y > 0.9 or plant.y < -5", "norm(plant.y, controller.y) >= 1.2 and time > 0.1")


@pytest.mark.parametrize("condition", CONDITIONS)
def test_a_run_that_diverges_ends_as_it_does_alone_and_others_go_on(condition: str, fmu: Path, kept: Kept) -> None:
    first = replace(of(LOOP, fmu), objectives={"peak": "max(plant.y)"}, criterion=Criterion(diverged=condition))
    crowd = [replace(first, seed=seed) for seed in range(6)]
    for what, found in zip(crowd, Batches().run(crowd)):
        alone = ran(what, "compiled", load=kept.load)
        assert found is not None
        assert (found.metrics, found.message) == (alone.metrics, alone.divergence)


def test_a_run_with_a_component_that_fails_or_becomes_infinite_is_left_to_be_run_alone(fmu: Path, kept: Kept) -> None:
    habits: Sequence[dict[str, float]] = ({}, {"fails_at": 0.3}, {"nan_at": 0.4}, {})
    crowd = [replace(of(LOOP, fmu, plant=habit), objectives={"peak": "max(plant.y)"}) for habit in habits]
    found = Batches().run(crowd)
    assert [each is None for each in found] == [False, True, True, False]
    alone = ran(crowd[3], "compiled", load=kept.load)
    assert found[3] is not None
    assert found[3].metrics == alone.metrics


def test_a_run_in_lanes_draws_its_samples_once_and_what_is_regular_is_found_once_for_all(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    made = dict.fromkeys(("timetable", "CommonTimetable"), 0)

    def counted(name: str) -> None:
        there = getattr(schedule_cache, name)

        def one(*given: Any, **named: Any) -> Any:
            made[name] += 1
            return there(*given, **named)

        monkeypatch.setattr(schedule_cache, name, one)

    for name in made:
        counted(name)
    late = Scenario(timing=Timing(jitter=0.002), stop_time=0.05).as_system()
    found = Batches().run([with_files(replace(late, seed=seed)) for seed in range(2)])
    assert None not in found
    assert made == {"timetable": 2, "CommonTimetable": 1}


@pytest.mark.parametrize("lanes", [2, 4])
def test_narrower_registers_give_the_same_bits(lanes: int, fmu: Path) -> None:
    first = replace(of(LOOP, fmu), objectives={"peak": "max(plant.y)", "rms": "rms(plant.y * controller.z)"})
    crowd = [replace(first, seed=seed) for seed in range(lanes)]
    wide = shape_of(first)
    narrow = replace(wide, lanes=lanes)
    found, expected = in_lanes(narrow, crowd), in_lanes(wide, crowd)
    for call, values in expected.reductions.items():
        assert found.reductions[call].tobytes() == values.tobytes()
    assert [rows.tobytes() for rows in found.signals] == [rows.tobytes() for rows in expected.signals]


def test_more_runs_than_lanes_of_many_timings_come_back_in_their_order() -> None:
    periods = [0.01, 0.02, 0.01, 0.015] * 4 + [0.05]
    systems = [
        changed(
            Scenario(timing=Timing(period=period), stop_time=0.5).as_system(),
            {"components.plant.parameters.mass": 1.0 + i / 50},
        )
        for i, period in enumerate(periods)
    ]
    there = [*map(with_files, systems)]
    for what, found in zip(there, Batches().run(there)):
        assert found is not None
        assert_the_same_numbers(found.metrics, ran(what, "compiled").metrics)


def test_a_component_that_cannot_be_run_in_lanes_is_named(tmp_path: Path) -> None:
    parts = {"one": Component(fmu=str(small(tmp_path)), step=0.01)}
    with pytest.raises(UsageError, match=r"components.one: small.fmu: expected a native FMU of this project's kit"):
        Batches().run([System(stop_time=0.1, components=parts)])
    assert fmus.native_twin(parts["one"].fmu) == parts["one"].fmu
