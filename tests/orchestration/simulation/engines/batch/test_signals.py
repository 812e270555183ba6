"""Runs in SIMD lanes have the signals of the same runs one after another, to the byte."""

from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from orchestration.systems.schedule import schedule_cache
from orchestration.systems.system.distribution import highest
from orchestration.systems.system.file import load_system
from orchestration.systems.system.model import System
from tests.extent import sample, tries
from tests.orchestration.components.fmi.small import needs_compiler
from tests.orchestration.quadrotor.scenarios.signals_table import flights, scenario_of
from tests.orchestration.simulation.engines.batch.lanes import assert_the_same_signals, in_lanes, located, shape_of
from tests.orchestration.simulation.engines.random_systems import TIMES, systems
from tests.orchestration.simulation.engines.test_compiled import Kept, of, ran
from tests.places import ROOT

pytestmark = needs_compiler
FLIGHTS = dict(flights())
EXAMPLES = sorted(ROOT.glob("examples/*/system.toml"))


def plain(system: System) -> System:
    """Without expressions, for which C would have to be compiled."""
    return replace(system, objectives={}, optional=(), criterion=type(system.criterion)())


@st.composite
def crowds(draw: st.DrawFn) -> list[System]:
    """Systems of one structure that differ in all that may differ from lane to lane."""
    first = draw(systems(most=4))
    crowd = [first]
    for place in range(draw(st.integers(1, 7))):
        parts = dict(first.components)
        for name, part in parts.items():
            if part.sampling is None:
                parts[name] = replace(part, step=draw(st.sampled_from((part.step, *TIMES))))
            elif part.sampling.clock == "master" and draw(st.booleans()):
                period = draw(st.sampled_from(TIMES))
                jitter, most = part.sampling.jitter, 0.9 * period / part.sampling.clock_ratio
                if highest(jitter) > most:
                    jitter = most
                parts[name] = replace(part, sampling=replace(part.sampling, period=period, jitter=jitter))
        wires = tuple(
            replace(x, delay=draw(st.sampled_from((x.delay, *TIMES)))) if x.delay else x for x in first.connections
        )
        stop_time = draw(st.sampled_from((first.stop_time, 0.15)))
        seed = first.seed + draw(st.integers(0, 1)) * (place + 1)
        crowd.append(replace(first, components=parts, connections=wires, stop_time=stop_time, seed=seed))
    return crowd


@settings(max_examples=tries(40, sampled=5), derandomize=True, deadline=None)
@given(crowds(), st.sampled_from((1, 70, schedule_cache.INSTANTS)))
def test_random_systems_have_the_same_signals_beside_any_others(
    fmu: Path, kept: Kept, crowd: list[System], instants: int
) -> None:
    systems = [of(what, fmu) for what in crowd]
    shape = shape_of(systems[0])
    with pytest.MonkeyPatch.context() as context:
        context.setattr(schedule_cache, "INSTANTS", instants)  # of a span
        found = in_lanes(shape, systems)
    for lane, what in enumerate(systems):
        assert_the_same_signals(shape, found, lane, ran(what, "compiled", load=kept.load))


@pytest.mark.parametrize("name", sample([*FLIGHTS], 3))
def test_flights_of_the_quadrotor_are_the_same(name: str) -> None:
    system = plain(located(scenario_of(FLIGHTS[name]["scenario"]).as_system()))
    shape = shape_of(system)
    found = in_lanes(shape, [system])
    assert_the_same_signals(shape, found, 0, ran(system, "compiled"))


@pytest.mark.parametrize("path", sample(EXAMPLES, 3), ids=lambda path: path.parent.name)
def test_examples_run_the_same_with_any_seed(path: Path) -> None:
    system = plain(located(replace(load_system(path), stop_time=3.0)))
    crowd = [replace(system, seed=seed) for seed in (1, 2, 3)]
    shape = shape_of(system)
    found = in_lanes(shape, crowd)
    for lane, what in enumerate(crowd):
        assert_the_same_signals(shape, found, lane, ran(what, "compiled"))
