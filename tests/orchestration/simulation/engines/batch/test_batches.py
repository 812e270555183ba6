"""Runs in SIMD lanes have the results of the same runs alone."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from orchestration.components.building import fmus
from orchestration.foundation.basics.errors import UsageError
from orchestration.quadrotor.scenarios.scenario import Scenario
from orchestration.quadrotor.scenarios.timing import Timing
from orchestration.simulation.engines.batch.batches import Batches
from orchestration.systems.schedule import schedule_cache
from orchestration.systems.system.component import Component, Sampling
from orchestration.systems.system.connection import Connection, Source
from orchestration.systems.system.files import located as with_files
from orchestration.systems.system.model import Criterion, System
from orchestration.systems.system.paths import changed
from tests.orchestration.components.fmi.small import needs_compiler, small
from tests.orchestration.simulation.engines.batch.lanes import LOOP, assert_the_same_numbers, in_lanes, shape_of
from tests.orchestration.simulation.engines.test_compiled import Kept, of, ran

pytestmark = needs_compiler


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


def test_a_row_between_the_points_of_a_component_has_it_on_a_line_and_such_runs_are_left_to_be_run_alone(
    fmu: Path, kept: Kept
) -> None:
    listener = Component(fmu="stub", sampling=Sampling(period=0.1))
    read, heard = LOOP.connections[0], Connection(name="heard", start=("controller.z",), end=("listener.u0z",))
    told = replace(
        of(replace(LOOP, components={**LOOP.components, "listener": listener}), fmu),
        connections=(replace(read, noise={}, loss=0.0), *LOOP.connections[1:], heard),
        objectives={"rms": "rms(plant.y)", "variation": "total_variation(plant.z - plant.y)",
                    "product": "integral(plant.y * controller.y)"},
    )  # fmt: skip
    told = changed(told, {"components.controller.sampling.jitter": 0.0, "connections.heard.delay": 0.0})
    late = changed(told, {"connections.heard.delay": 0.0037})
    usual, between = (ran(each, "compiled", load=kept.load) for each in (told, late))
    assert len(between.rows) > len(usual.rows)
    for name in ("rms", "variation"):
        assert between.metrics[name] == usual.metrics[name]
    assert between.metrics["product"] == pytest.approx(usual.metrics["product"], rel=1e-12)
    assert [each is None for each in Batches().run([told, late])] == [False, True]


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
        assert_the_same_numbers(what, found.metrics, ran(what, "compiled").metrics)


def test_a_component_that_cannot_be_run_in_lanes_is_named(tmp_path: Path) -> None:
    parts = {"one": Component(fmu=str(small(tmp_path)), step=0.01)}
    with pytest.raises(UsageError, match=r"components.one: small.fmu: expected a native FMU of this project's kit"):
        Batches().run([System(stop_time=0.1, components=parts)])
    assert fmus.native_twin(parts["one"].fmu) == parts["one"].fmu
