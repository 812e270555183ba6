"""Limits: the search, the criterion, and linear theory against flights from tiny errors."""

import dataclasses
import itertools
import json
import math
from collections.abc import Iterator, Sequence
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import quadcosim
from orchestration.components.fmi.reuse import Instances
from orchestration.experiments.limits import limit as limits
from orchestration.experiments.limits import notes
from orchestration.experiments.limits.evaluation import is_good
from orchestration.experiments.limits.limit_result import ContinuousRun, LimitInterrupted, as_text, shares_as_text
from orchestration.foundation.basics.bisection import Bracket, Ends, Range, ends_of_good, first_failure
from orchestration.foundation.basics.simulator import Floats
from orchestration.foundation.basics.statistics import wilson
from orchestration.foundation.basics.times import NANOSECONDS
from orchestration.quadrotor.flight import hover_limit as local
from orchestration.quadrotor.flight.hover import COORDINATES, hover_of
from orchestration.quadrotor.flight.hover_limit import local_limit
from orchestration.quadrotor.flight.hover_loop import HoverLoop
from orchestration.quadrotor.scenarios.fmu_choice import FmuChoice, Record
from orchestration.quadrotor.scenarios.wiring import COMMAND
from orchestration.simulation.requests.ranges import Varied, search_range
from orchestration.simulation.runs.prepared import prepared
from orchestration.systems.system.distribution import lowest
from orchestration.systems.system.file import system_from_tables
from orchestration.systems.system.files import files_of
from orchestration.systems.system.model import Criterion, System
from orchestration.theory.stability.known_loops import LinearLimit
from orchestration.theory.stability.local_limit import local_limits
from quadcosim import Result, Scenario, Timing, UsageError
from tests.examples.common import native_example as example
from tests.extent import sample
from tests.fmus import source_tree
from tests.native import NATIVE
from tests.orchestration.experiments.studies.common import at, one_line, short

SAMPLED = [f"plant.{name}" for name in COORDINATES]
HELD = [f"plant.{name}" for name in COMMAND]


@pytest.fixture(scope="module")
def fleet() -> Iterator[Instances]:
    """FMUs for many short flights."""
    made = Instances()
    yield made
    made.close()


def fly(scenario: Scenario, fleet: Instances) -> Result:
    with prepared(scenario, load=fleet.load) as flight:
        flight.master.initialise()
        flight.master.run()
        return flight.result()


# -- the search -------------------------------------------------------------------------------------------


@given(edge=st.floats(0.0, 10.0), tolerance=st.floats(1e-6, 1.0))
def test_the_edge_of_failure_lies_in_the_bracket(edge: float, tolerance: float) -> None:
    found = first_failure(lambda value: value > edge, [0.0, 1.0, 2.0, 3.0, 5.0, 8.0, 11.0], tolerance)
    assert found is not None
    good, bad = found
    assert good is not None
    assert good <= edge < bad
    assert bad - good <= tolerance


@given(holes=st.lists(st.tuples(st.floats(0.5, 20.0), st.floats(0.001, 3.0)), min_size=1, max_size=5))
def test_with_islands_of_failure_the_bracket_is_a_true_one_below_the_first_value_that_fails(
    holes: list[tuple[float, float]],
) -> None:
    def fails(value: float) -> bool:
        return any(start <= value <= start + width for start, width in holes)

    values = [float(i) for i in range(21)]
    found = first_failure(fails, values, 1e-3)
    first = next((value for value in values if fails(value)), None)
    if first is None:
        assert found is None
        return
    assert found is not None
    good, bad = found
    assert good is not None
    assert first - 1.0 <= good < bad <= first
    assert bad - good <= 1e-3
    assert fails(bad)
    assert not fails(good)


@pytest.mark.parametrize(
    ("of", "first", "step", "last"),
    [
        ("connections.command.delay", 0.0, 0.003, 0.3),
        ("connections.command.delay_jitter", 0.0, 0.003, 0.06),
        ("connections.command.loss", 0.0, 0.05, 1.0),
        ("components.controller.sampling.jitter", 0.0, 0.0006, 0.005994),
        ("components.controller.sampling.period", 0.003, 0.003, 0.3),
    ],
)
def test_times_of_a_system_are_searched_in_units_of_the_period_unless_told_otherwise(
    of: str, first: float, step: float, last: float
) -> None:
    varied = Varied(request=example("dc_servo"), of=of)
    span = search_range(varied, {}, first=None, last=None, tolerance=None, scan=None)
    assert (span.first, span.step, span.last) == pytest.approx((first, step, last))
    assert search_range(varied, {}, first=0.001, last=None, tolerance=None, scan=None).first == 0.001


def test_an_island_of_failure_within_the_bracket_is_seen_by_the_finer_steps() -> None:
    def fails(value: float) -> bool:
        return 1.15 < value < 1.35 or value > 1.75

    assert first_failure(fails, [0.0, 1.0, 2.0], 0.01, parts=1) == pytest.approx((1.75, 1.76), abs=0.01)
    good, bad = first_failure(fails, [0.0, 1.0, 2.0], 0.01, parts=5) or (None, math.nan)
    assert (good, bad) == pytest.approx((1.15, 1.16), abs=0.01)


@given(
    edge=st.floats(0.0, 12.0),
    tolerance=st.sampled_from([1.1e-6, 0.011, 0.13, 0.21, 0.31, 0.97, 4.1]),
    parts=st.integers(1, 6),
)
def test_the_number_of_remaining_values_is_a_decreasing_bound(edge: float, tolerance: float, parts: int) -> None:
    bounds: list[int] = []
    values = [0.0, 1.0, 2.0, 3.0, 5.0, 8.0, 11.0]
    first_failure(lambda value: value > edge, values, tolerance, parts=parts, remaining=bounds.append)
    assert all(bound >= really for bound, really in zip(reversed(bounds), range(len(bounds))))
    assert bounds == sorted(bounds, reverse=True)
    assert bounds[0] < len(values) + parts + 22  # halvings of the widest step to the finest tolerance


def test_good_values_around_the_own_one_have_both_ends_and_those_apart_from_it_are_not_joined() -> None:
    def fails(value: float) -> bool:
        return not (1.0 <= value <= 1.2 or 2.3 < value < 4.6)

    values = [float(i) for i in range(1, 9)]
    lower, upper = ends_of_good(fails, values, 3.0, 0.125)
    assert lower is not None
    assert lower.good is not None
    assert lower.bad <= 2.3 < lower.good <= lower.bad + 0.125
    assert upper == first_failure(fails, values[2:], 0.125)
    assert ends_of_good(fails, values, 7.0, 0.125) == (None, first_failure(fails, values, 0.125))
    assert ends_of_good(lambda value: value > 4.6, values, 3.0, 0.5) == Ends(None, Bracket(4.5, 5.0))
    assert ends_of_good(lambda value: value < 2.6, values, 3.0, 0.5) == Ends(Bracket(3.0, 2.5), None)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_over_decades_both_ends_of_good_values_are_found_by_equal_factors_to_a_share(sign: float) -> None:
    of_fmu = Varied(request=example("double_integrator"), of="components.controller.parameters.k_d")
    models = files_of(of_fmu.system).models_of(of_fmu.system)
    first, last = sorted((sign * 1e-3, sign * 1e9))
    span = search_range(of_fmu, models, first=first, last=last, tolerance=None, scan=None)
    assert [abs(value) for value in span.values()[:: int(sign)]][:5] == [0.001, 0.00158, 0.00251, 0.00398, 0.00631]
    assert (span.values()[0], span.values()[-1], span.step_text) == (first, last, "a factor of 1.6")
    ends = ends_of_good(
        lambda value: not 700.0 < sign * value < 1800.0, span.values(), sign * 1000.0, span.tolerance,
        geometric=span.geometric, parts=5,
    )  # fmt: skip
    for end, edge in zip(ends if sign > 0.0 else ends[::-1], (700.0, 1800.0)):
        assert end is not None
        assert end.good is not None
        assert sorted((sign * end.good, sign * end.bad, edge))[1] == edge
        assert abs(end.bad / end.good - 1.0) < 0.0101
    assert span.tolerance_at(sign * 700.0) == pytest.approx(7.0)
    for low, high, tolerance, scan in ((first, last, 1.0, None), (first, last, None, 1e5), (0.0, 1e9, None, None)):
        assert not search_range(of_fmu, models, first=low, last=high, tolerance=tolerance, scan=scan).geometric


def test_the_own_value_is_scanned_where_it_lies_in_the_range() -> None:
    varied = Varied(request=example("dc_servo", {"connections.command.delay": 0.0047}), of="connections.command.delay")
    span = search_range(varied, {}, first=None, last=None, tolerance=None, scan=None)
    assert (span.own, span.values()[:4]) == (0.0047, [0.0, 0.003, 0.0047, 0.006])
    assert search_range(varied, {}, first=0.001, last=None, tolerance=None, scan=None).own == 0.0047
    assert search_range(varied, {}, first=0.005, last=None, tolerance=None, scan=None).own is None
    of_fmu = Varied(request=example("double_integrator"), of="components.controller.parameters.k_d")
    models = files_of(of_fmu.system).models_of(of_fmu.system)
    assert search_range(of_fmu, models, first=0.1, last=2.1, tolerance=None, scan=None).own == 1.0


@pytest.mark.parametrize(("share", "last"), [(1.0, 5.0), (0.2, 1.0)])
def test_a_delay_of_many_periods_is_searched_well_beyond_what_the_file_has(share: float, last: float) -> None:
    varied = Varied(request=example("dc_servo", {"connections.command.delay": 0.5}), of="connections.command.delay")
    span = search_range(varied, {}, first=None, last=None, tolerance=None, scan=None, share=share)
    assert (span.own, span.step, span.last) == pytest.approx((0.5, 0.05, last))
    assert len(span.values()) <= 101


def test_steps_finer_than_the_tolerance_are_not_taken() -> None:
    tried = []

    def fails(value: float) -> bool:
        tried.append(value)
        return value > 1.4

    assert first_failure(fails, [1.0, 2.0], 0.5, parts=5) == (1.0, 1.5)
    assert tried == [1.0, 2.0, 1.5]


def test_parts_that_are_narrower_than_the_tolerance_by_rounding_alone_are_scanned() -> None:
    tried: list[float] = []

    def fails(value: float) -> bool:
        tried.append(value)
        return value > 0.45

    first_failure(fails, [0.3, 0.4, 0.5], 0.02, parts=5)
    assert tried[:6] == [0.3, 0.4, 0.5, 0.42, 0.44, 0.46], "although (0.5 - 0.4)/5 < 0.02 in floating point"


def test_nothing_above_the_first_value_that_fails_is_tried() -> None:
    tried = []

    def fails(value: float) -> bool:
        tried.append(value)
        return 2.5 < value < 3.5  # good values above are not evaluated

    assert first_failure(fails, [1.0, 2.0, 3.0, 4.0], 0.5) == (2.5, 3.0)
    assert tried == [1.0, 2.0, 3.0, 2.5]


def test_the_search_reports_that_nothing_fails_or_that_the_first_value_does() -> None:
    assert first_failure(lambda value: False, [1.0, 2.0], 0.1) is None
    assert first_failure(lambda value: True, [1.0, 2.0], 0.1) == (None, 1.0)


@pytest.mark.parametrize(("given", "expected"), [(True, True), (1.0, True), (False, False), (None, False)])
def test_what_is_good_meets_the_criterion(given: float | None, expected: bool) -> None:
    assert is_good({"good": given}) is expected


# -- linear theory ----------------------------------------------------------------------------------------


def scenario_of(coupling: float = 1.0, **timing: Any) -> Scenario:
    base = dataclasses.replace(NATIVE, timing=Timing(**{"plant_interval": 0.02, **timing}))
    return base.with_changes(parameters={"controller.coupling": coupling})


@cache
def theory(coupling: float = 1.0, **timing: Any) -> float:
    """The local limit of the period [s]."""
    scenario = scenario_of(coupling, **timing)
    found = local_limit(HoverLoop.of(scenario), scenario, "period")
    assert found is not None
    return found


def disturbed(scenario: Scenario, size: float, *coordinates: str) -> Scenario:
    """Hover except for small initial values of some coordinates."""
    hover = hover_of(scenario)
    return hover.with_changes(parameters={f"plant.initial.{name}": size for name in coordinates})


def growth(scenario: Scenario, periods: int, fleet: Instances) -> float:
    """How the error about hover grows from the second quarter of a flight to the last, from 1e-8 at first."""
    stop_time = periods * scenario.timing.period
    tilted = disturbed(scenario, 1e-8, "position.x", "position.y", "position.z", "quaternion.x", "quaternion.z")
    result = fly(dataclasses.replace(tilted, stop_time=stop_time), fleet)
    error = np.linalg.norm([result.signals[name] for name in SAMPLED], axis=0)
    assert error.max() < 1e-4, "expected to stay far below the boundary layer of 1 mm"
    share = result.signals["time"] / stop_time
    return float(error[share > 0.75].max() / error[(share > 0.25) & (share < 0.5)].max())


# The number of periods is what tells growth from decay at one per cent from the limit, and no more.
CASES = [(0.0, 0.0, 60), (1.0, 0.0, 60), (5.0, 0.0, 60), (0.0, 0.01, 30), (1.0, 0.01, 30), (5.0, 0.01, 200),
         (0.0, 0.03, 200), (1.0, 0.03, 200), (5.0, 0.03, 200)]  # fmt: skip


@pytest.mark.parametrize(("coupling", "delay", "periods"), sample(CASES, 3))
def test_tiny_errors_shrink_one_per_cent_below_the_local_limit_and_grow_one_per_cent_above(
    coupling: float, delay: float, periods: int, fleet: Instances
) -> None:
    limit = theory(coupling, delay=delay)
    below, above = (
        growth(scenario_of(coupling, delay=delay, period=factor * limit), periods, fleet) for factor in (0.99, 1.01)
    )
    assert below < 0.95
    assert above > 1.05


def test_the_local_limit_of_the_gains_of_the_paper_is_80_ms() -> None:
    assert theory() == pytest.approx(0.080, abs=0.0005)
    assert theory(plant_interval=0.001) == pytest.approx(theory(), rel=1e-3)


def test_at_the_local_limit_the_spectral_radius_crosses_one() -> None:
    loop, limit = HoverLoop.of(scenario_of()), theory()
    assert loop.spectral_radius(limit - 1e-5, 0.0) < 1.0 < loop.spectral_radius(limit + 1e-5, 0.0)


def test_the_local_limit_of_the_delay_is_where_the_limit_of_the_period_with_it_is() -> None:
    scenario = scenario_of(period=0.03)
    delay = local_limit(HoverLoop.of(scenario), scenario, "delay")
    assert delay is not None
    loop = HoverLoop.of(scenario)
    assert loop.spectral_radius(0.03, delay - 1e-5) < 1.0 < loop.spectral_radius(0.03, delay + 1e-5)


def test_a_clock_that_runs_fast_moves_the_local_limit_by_its_ratio() -> None:
    assert theory(clock_ratio=1.25) == pytest.approx(1.25 * theory(), rel=2e-3)


# -- the matrix against flights ---------------------------------------------------------------------------


def flown_derivatives(scenario: Scenario, instants: Sequence[float], fleet: Instances) -> Floats:
    """d(vehicle, command)/d(vehicle at 0) through the master at each instant, shape (n, 16, 12)."""
    size = 1e-6
    moved = []
    for name in COORDINATES:
        plus, minus = (values_at(disturbed(scenario, sign * size, name), instants, fleet) for sign in (1.0, -1.0))
        moved.append((plus - minus) / (2.0 * size))
    return np.stack(moved, axis=-1)


def values_at(scenario: Scenario, instants: Sequence[float], fleet: Instances) -> Floats:
    """The twelve coordinates and the command that the plant has at each instant, shape (n, 16)."""
    result = fly(dataclasses.replace(scenario, stop_time=max(instants)), fleet)
    time = np.round(result.signals["time"] * NANOSECONDS).astype(int)
    rows = [int(np.flatnonzero(time == round(instant * NANOSECONDS))[0]) for instant in instants]
    values: Floats = np.column_stack([result.signals[name] for name in (*SAMPLED, *HELD)])[rows]
    return values


def expect_powers(matrix: Floats, scenario: Scenario, fleet: Instances) -> None:
    """Expect d(vehicle after k periods)/d(vehicle) to be that of the k-th power of `matrix`, flown."""
    period = scenario.timing.period
    first, *flown = flown_derivatives(scenario, [k * period for k in range(6)], fleet)
    # Until a command arrives the plant holds that of the initialisation, as if it had been sent before, too.
    held = (len(matrix) - 12) // 4
    state = np.vstack([np.eye(12), *[first[12:]] * held])
    for derivative in flown:
        state = matrix @ state
        assert np.abs(derivative[:12] - state[:12]).max() < 1e-4 * np.abs(state[:12]).max()


LOOPS: list[tuple[dict[str, Any], float, int]] = [
    ({"period": 0.04}, 0.0, 16),
    ({"period": 0.04, "delay": 0.013}, 0.0, 20),
    ({"period": 0.02, "delay": 0.05}, 0.0, 28),  # beyond the period: two and a half of them
    ({"period": 0.02, "delay": 0.04}, 0.0, 24),
    ({"period": 0.04}, 0.05, 20),  # actuators that lag
    ({"period": 0.02, "delay": 0.03}, 0.05, 28),
]


@pytest.mark.parametrize(("timing", "lag", "size"), sample(LOOPS, 2))
def test_powers_of_the_matrix_are_derivatives_of_whole_periods_of_flight(
    timing: dict[str, Any], lag: float, size: int, fleet: Instances
) -> None:
    base = scenario_of(plant_interval=0.005, **timing)
    base = base.with_changes(parameters={"plant.actuator_time_constant": lag})
    matrix = HoverLoop.of(base).matrix(base.timing.period, lowest(base.timing.delay))
    assert matrix.shape == (size, size)
    expect_powers(matrix, base, fleet)


MOTORS = {"thrust_max": 9.0, "arm.x": 0.1, "arm.y": 0.2, "drag_to_thrust": 0.1, "time_constant.up": 0.05}


def with_motors(down: float) -> Scenario:
    """At 40 ms and 10 ms of delay, with motors of which each rises with a time constant of 50 ms."""
    motors = {f"plant.motor.{name}": value for name, value in MOTORS.items()}
    return scenario_of(period=0.04, delay=0.01).with_changes(
        parameters={**motors, "plant.motor.time_constant.down": down}
    )


def test_motors_are_in_the_loop_as_separate_lags() -> None:
    lagging = scenario_of(period=0.04, delay=0.01).with_changes(parameters={"plant.actuator_time_constant": 0.05})
    by_motors, by_box = (HoverLoop.of(scenario).matrix(0.04, 0.01) for scenario in (with_motors(0.05), lagging))
    assert by_motors == pytest.approx(by_box, rel=1e-6, abs=1e-6)


def range_of(scenario: Scenario) -> Range:
    found = scenario.range_of("period")
    assert found is not None
    return found


def test_motors_that_rise_and_fall_differently_have_no_local_limit() -> None:
    scenario = with_motors(0.1)
    found = local_limits(Varied(request=scenario, of="period"), range_of(scenario))
    assert (found.limit, found.method) == (None, None)
    assert found.reason == (
        "no local limit: the plant responds differently to a rise and to a fall, so hover has no linear loop"
    )


def test_the_default_lag_of_an_fmu_is_in_the_loop(tmp_path: Path) -> None:
    sources = source_tree.copy_sources(tmp_path)
    source_tree.replace(
        sources / "plant_fmu" / "actuators.py", "time_constant: float = 0.0", "time_constant: float = 0.05"
    )
    lagging = source_tree.build(sources, tmp_path, "QuadrotorPlant")
    by_itself = dataclasses.replace(scenario_of(), plant=FmuChoice(fmu=str(lagging)))
    by_parameter = scenario_of().with_changes(parameters={"plant.actuator_time_constant": 0.05})
    own, set_to = (HoverLoop.of(scenario).matrix(0.04, 0.01) for scenario in (by_itself, by_parameter))
    assert own.shape == (24, 24)
    assert own == pytest.approx(set_to, abs=1e-9)
    assert set_to[12:16, 12:16] == pytest.approx(math.exp(-0.04 / 0.05) * np.eye(4), abs=1e-6)


@pytest.mark.parametrize(("exponent", "limit"), [(0.5, 0.0085), (0.99, 0.0801)])
def test_at_the_edge_of_the_boundary_layer_the_exponent_matters(exponent: float, limit: float) -> None:
    scenario = scenario_of().with_changes(parameters={"controller.surface_exponent": exponent})
    found = known_local_limits(Varied(request=scenario, of="period"), range_of(scenario))
    assert found.limit == theory()
    assert found.outside == pytest.approx(limit, abs=1e-4)


def test_differences_stay_inside_a_boundary_layer_that_is_small() -> None:
    small = {"controller.boundary_layer": 1e-7, "controller.surface_exponent": 0.5}
    scenario = scenario_of().with_changes(parameters=small)
    assert HoverLoop.of(scenario).spectral_radius(0.05, 0.0) == pytest.approx(
        HoverLoop.of(scenario_of()).spectral_radius(0.05, 0.0), rel=1e-5
    )


def test_with_jacobi_order_the_loop_is_that_of_a_delay_of_one_period(fleet: Instances) -> None:
    jacobi = scenario_of(plant_interval=0.005, period=0.03, order="jacobi")
    expect_powers(HoverLoop.of(jacobi).matrix(0.03, 0.03), jacobi, fleet)


def test_the_local_limit_with_jacobi_order_is_that_of_a_delay_of_one_period() -> None:
    limit, loop = theory(order="jacobi"), HoverLoop.of(scenario_of())
    assert loop.spectral_radius(limit - 1e-5, limit - 1e-5) < 1.0 < loop.spectral_radius(limit + 1e-5, limit + 1e-5)
    assert limit < theory()


def test_actuators_that_lag_lower_the_local_limit_and_a_short_lag_hardly_matters() -> None:
    def lagging(lag: float) -> float:
        scenario = scenario_of().with_changes(parameters={"plant.actuator_time_constant": lag})
        found = local_limit(HoverLoop.of(scenario), scenario, "period")
        assert found is not None
        return found

    assert lagging(1e-4) == pytest.approx(theory(), rel=0.02)
    assert lagging(0.05) < 0.95 * theory()


def test_the_wind_and_the_reference_of_a_scenario_do_not_change_its_local_limit() -> None:
    other = {"plant.wind.amplitude.x": 3.0, "plant.initial.position.z": 9.0, "controller.trajectory.amplitude_x": 1.0}
    scenario = scenario_of().with_changes(parameters=other)
    assert local_limit(HoverLoop.of(scenario), scenario, "period") == theory()


def test_hover_stays_at_hover(fleet: Instances) -> None:
    result = fly(dataclasses.replace(hover_of(scenario_of()), stop_time=1.0), fleet)
    assert max(float(np.abs(result.signals[name]).max()) for name in SAMPLED) < 1e-12


def test_a_controller_with_another_mass_has_no_hover_to_linearise_about() -> None:
    scenario = scenario_of().with_changes(parameters={"controller.mass": 1.1})
    with pytest.raises(UsageError, match=r"hover is no equilibrium.*expected a controller with the plant's mass") as no:
        HoverLoop.of(scenario)
    one_line(no.value)


# -- the measured limit -----------------------------------------------------------------------------------


class StubPool:
    """Replaces the runs: a rule decides whether a run is good, and the requested systems are kept."""

    systems: list[System]

    def __init__(self, *arguments: Any) -> None:
        StubPool.systems = []

    def __enter__(self) -> "StubPool":
        return self

    def __exit__(self, *exception: object) -> None:
        return None

    def run_until(self, systems: Sequence[System], stop: Any, report: Any = lambda done: None) -> list[dict[str, Any]]:
        found: list[dict[str, Any]] = []
        for system in systems:
            self.systems.append(system)
            bound = self.bound(system)
            outcome = "settled" if bound < 0.05 else "bounded" if bound < math.inf else "diverged"
            divergence_time = 3.25 if outcome == "diverged" else None
            found.append(
                {
                    "outcome": outcome,
                    "good": bound < 0.05,
                    "divergence_time": divergence_time,
                    "settling_time": 1.5,
                    "ultimate_bound": bound,
                }
            )
            report(len(found))
            if stop(found[-1]):
                break
        return found

    @staticmethod
    def bound(system: System) -> float:
        return 0.01 if at(system, "timing.period") < 0.0317 and at(system, "timing.delay") < 0.0123 else 1.0


@pytest.fixture
def stubbed(monkeypatch: pytest.MonkeyPatch) -> type[StubPool]:
    monkeypatch.setattr(limits, "RunEvaluator", StubPool)
    monkeypatch.setattr(limits, "local_limits", known_local_limits)
    monkeypatch.setattr(limits, "mean_square_limit", lambda *given: LinearLimit(reason="not looked for"))
    monkeypatch.setattr(local, "about_rest", lambda at, span: LinearLimit(reason="not looked for"))
    return StubPool


_KNOWN: dict[str, LinearLimit] = {}


def known_local_limits(varied: Varied, span: Range, *_: object) -> LinearLimit:
    """The local limits of linear theory, computed once for the tests with the same scenario."""
    key = f"{varied.of} {varied.request}"
    if key not in _KNOWN:
        _KNOWN[key] = local_limits(varied, span)
    return _KNOWN[key]


def unseeded(system: System) -> System:
    return dataclasses.replace(system, seed=0)


@pytest.mark.usefixtures("stubbed")
@pytest.mark.parametrize("tolerance", [None, 0.004, 1e-5])
def test_the_large_signal_limit_is_the_last_good_value_to_the_tolerance(tolerance: float | None) -> None:
    found = limits.limit(scenario_of(), "period", tolerance=tolerance)
    assert found.tolerance == (tolerance or 0.0005)
    assert found.large_signal_limit is not None
    assert 0.0317 - found.tolerance <= found.large_signal_limit < 0.0317


@pytest.mark.usefixtures("stubbed")
def test_of_two_objectives_the_one_is_shown_whose_bound_is_missed_first(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(limits, "local_limits", lambda *given: LinearLimit(reason="not looked for"))
    judged = Criterion(good="settling_time < 5 and ultimate_bound < 0.05")
    system = dataclasses.replace(scenario_of().as_system(), criterion=judged)
    found = limits.limit(system, "components.controller.sampling.period", first=0.01, last=0.05)
    assert (found.judged, found.judged_bound) == ("ultimate_bound", 0.05)
    assert {one.measured for one in found.tried} == {0.01, 1.0}


def test_only_the_quantity_varies(stubbed: type[StubPool]) -> None:
    base = scenario_of(period=0.02)
    found = limits.limit(base, "delay")
    assert found.large_signal_limit == pytest.approx(0.0123, abs=0.0005)
    assert all(
        flown == base.with_changes(timing={"delay": at(flown, "timing.delay")}).as_system() for flown in stubbed.systems
    )


@pytest.mark.usefixtures("stubbed")
def test_a_gap_of_more_than_a_tenth_of_the_local_limit_is_noted() -> None:
    found = limits.limit(scenario_of(), "period")
    assert found.local_limit == pytest.approx(0.080, abs=0.0005)
    assert "more than a tenth below the local limit" in "\n".join(found.notes)
    assert "by large signals or as small ones decay too slowly for the horizon" in "\n".join(found.notes)


def test_a_limit_within_a_tenth_of_the_local_limit_is_noted(
    stubbed: type[StubPool], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(stubbed, "bound", lambda self, system: 0.01 if at(system, "timing.period") < 0.078 else 1.0)
    assert "within a tenth of the local limit" in "\n".join(limits.limit(scenario_of(), "period").notes)
    monkeypatch.setattr(limits, "local_limits", lambda *given: LinearLimit(limit=0.07, accuracy=0.01))
    note = limits.limit(scenario_of(), "period").notes[-1]
    assert note.endswith("not told apart from the local limit, which is 70 ms ± 10 ms")


@pytest.mark.usefixtures("stubbed")
def test_a_limit_as_coarse_as_its_tolerance_is_not_said_to_be_below_the_local_one(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(limits, "local_limits", lambda *given: LinearLimit(limit=0.06))
    note = limits.limit(scenario_of(), "period", first=0.02, scan=0.06, tolerance=0.06).notes[-1]
    assert note.endswith("within a tenth of the local limit of 60 ms, to the tolerance")


def test_a_limit_names_the_lowest_value_at_which_deadlines_are_missed() -> None:
    tasks = {name: {"period": 0.004, "priority": i, "execution": 0.002} for i, name in enumerate(("fast", "load"))}
    system = system_from_tables({"stop_time": 0.1, "computers": {"cpu": {"tasks": tasks}}}, Path())
    varied = Varied(request=system, of="computers.cpu.tasks.load.execution")
    span = Range(first=0.001, step=0.0015, last=0.004, tolerance=1e-5)
    assert limits._missed_from(varied, span, [0.001, 0.002]) is None  # 100 % busy, and in time
    assert limits._missed_from(varied, span, [0.001, 0.0025, 0.003]) == pytest.approx(0.002 + 0.5e-5, abs=0.5e-5)
    late = notes._where_missed(0.002, LinearLimit(limit=0.003), span)
    assert late[0].startswith("where deadlines are missed, from 2 ms on, stability need not be an interval")
    assert notes._where_missed(0.004, LinearLimit(limit=0.003), span) == []
    assert notes._overloaded(varied, span, [0.001, 0.002]) == []
    (note,) = notes._overloaded(varied, span, [0.001, 0.0025, 0.003])
    assert note.startswith(
        "at 2.5 ms to 3 ms: computers.cpu: overloaded, its tasks demand up to 125 % of its time: jobs of load wait"
    )
    varied = Varied(request=system, of="computers.cpu.tasks.fast.execution")
    assert notes._starved(varied, span, [0.001, 0.0025]) == []  # late, and done
    assert notes._starved(varied, span, [0.0025, 0.004, 0.005]) == [
        "at 4 ms cpu.load is never done: small deviations are of the loop without it"
    ]


def test_linear_theory_tries_the_values_at_which_runs_fail(
    stubbed: type[StubPool], monkeypatch: pytest.MonkeyPatch
) -> None:
    def theory(varied: Varied, span: Range, *_: object) -> LinearLimit:
        return LinearLimit(limit=span.values()[span.values().index(0.035) - 1])

    monkeypatch.setattr(limits, "local_limits", theory)
    assert 0.0317 < (limits.limit(scenario_of(), "period", first=0.03, scan=0.005).local_limit or 0.0) < 0.035
    monkeypatch.setattr(limits, "local_limits", lambda *given: LinearLimit(limit=0.031))
    monkeypatch.setattr(stubbed, "bound", lambda self, system: 0.01 if at(system, "timing.period") < 0.0334 else 1.0)
    note = limits.limit(scenario_of(), "period", first=0.03, scan=0.005).notes[-1]
    assert note.endswith("31 ms, from which on small motions grow: a run of 30 s does not show slow growth")


def test_a_range_without_failures_or_without_good_values_is_noted(
    stubbed: type[StubPool], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(stubbed, "bound", lambda self, system: 0.01)
    nothing_fails = limits.limit(scenario_of(), "jitter")
    assert nothing_fails.large_signal_limit is None
    assert "good throughout the scan" in nothing_fails.verdict
    assert "ultimate_bound is 10 mm at each value tried, as where nothing moves" in "\n".join(nothing_fails.notes)
    monkeypatch.setattr(stubbed, "bound", lambda self, system: 1.0)
    nothing_good = limits.limit(scenario_of(), "delay")
    assert nothing_good.large_signal_limit is None
    assert "not good even at 0 s, where the scan begins" in nothing_good.verdict


@pytest.mark.parametrize(
    ("of", "timing", "confidence", "seeds"),
    [("jitter", {}, 0.99, 44), ("loss", {}, 0.5, 7), ("period", {"noise": {"position": 0.001}}, 0.95, 29),
     ("delay", {"delay_jitter": 0.001}, 0.5, 7), ("period", {"command_loss": 0.1}, 0.5, 7)],
)  # fmt: skip
def test_random_quantities_take_enough_seeds_for_nine_in_ten_at_the_confidence(
    stubbed: type[StubPool], of: str, timing: dict[str, Any], confidence: float, seeds: int
) -> None:
    base = dataclasses.replace(scenario_of(**timing), seed=5)
    found = limits.limit(base, of, confidence=confidence)
    assert (found.seeds, found.confidence) == (seeds, confidence)
    assert 0.9**seeds <= 1.0 - confidence < 0.9 ** (seeds - 1)  # the success run
    flown = [[one.seed for one in group] for _, group in itertools.groupby(stubbed.systems, key=unseeded)]
    assert flown[0] == list(range(5, 5 + seeds))
    assert {seed for group in flown for seed in group} == set(flown[0])


def test_one_seed_that_is_not_good_is_enough_to_fail(stubbed: type[StubPool], monkeypatch: pytest.MonkeyPatch) -> None:
    def bound(self: StubPool, system: System) -> float:
        return 1.0 if system.seed == 28 and at(system, "timing.loss") > 0.222 else 0.01

    monkeypatch.setattr(stubbed, "bound", bound)
    found = limits.limit(scenario_of(), "loss")
    assert found.large_signal_limit == pytest.approx(0.222, abs=0.01)
    assert found.local_limit is None
    assert "linear theory has no local limit of loss" in "\n".join(found.notes)


def test_good_values_above_the_limit_are_reported(stubbed: type[StubPool], monkeypatch: pytest.MonkeyPatch) -> None:
    def bound(self: StubPool, system: System) -> float:
        return 1.0 if 0.0317 < at(system, "timing.period") < 0.042 else 0.01

    monkeypatch.setattr(stubbed, "bound", bound)
    found = limits.limit(scenario_of(), "period")
    assert found.large_signal_limit == pytest.approx(0.0317, abs=0.0005)
    assert found.flies_above == (0.045, 0.05, 0.055)
    assert [one.value for one in found.tried if one.value >= 0.035] == [0.035, 0.04, 0.045, 0.05, 0.055]
    assert found.scan == 0.005
    assert "narrower than the scan, 5 ms, is not seen" in "\n".join(found.notes)
    coarse = limits.limit(scenario_of(), "period", scan=0.05)
    assert (coarse.scan, coarse.large_signal_limit) == (0.05, None), "as its help says, it sees no gap that small"


def test_values_that_are_good_in_a_band_around_the_own_one_have_both_ends(
    stubbed: type[StubPool], monkeypatch: pytest.MonkeyPatch
) -> None:
    def bound(self: StubPool, system: System) -> float:
        return 0.01 if 0.0062 < at(system, "timing.period") < 0.0317 else math.inf

    monkeypatch.setattr(stubbed, "bound", bound)
    found = limits.limit(scenario_of(), "period")
    assert found.verdict == (
        "period good from 6.25 ms up to 31.5 ms; diverges at 31.75 ms; diverges at 6 ms (scan 5 ms, tolerance 0.5 ms)"
    )
    assert (found.large_signal_limit, found.large_signal_lower_limit) == (0.0315, 0.00625)
    assert (
        "scanned from 5 ms to 55 ms, as a search ends soon after what fails: beyond that nothing is known"
        in found.notes
    )
    from_below = limits.limit(scenario_of(), "period", first=0.005)
    assert (from_below.large_signal_limit, from_below.large_signal_lower_limit) == (0.0315, 0.00625)
    without_own = limits.limit(scenario_of(), "period", first=0.035)
    assert without_own.verdict.startswith("period not good even at 35 ms, where the scan begins: diverged")
    assert "with --from 0.01 --to 0.5 the search would go up and down from the file's own value" in "\n".join(
        without_own.notes
    )
    bad_own = limits.limit(scenario_of(period=0.04), "period")
    assert "the file's own value, 40 ms, is not good either" in "\n".join(bad_own.notes)


@pytest.mark.parametrize(
    ("bound", "expected"),
    [(1.0, "not at 30 ms: bounded, ultimate_bound = 1 m, expected < 0.05 m"), (math.inf, "diverges at 30 ms")],
)
def test_the_outcome_of_the_failing_value_is_in_the_verdict(
    stubbed: type[StubPool], monkeypatch: pytest.MonkeyPatch, bound: float, expected: str
) -> None:
    monkeypatch.setattr(stubbed, "bound", lambda self, system: 0.01 if at(system, "timing.period") < 0.03 else bound)
    found = limits.limit(scenario_of(), "period")
    assert expected in found.verdict
    assert found.horizon == 30.0


def test_the_value_at_which_nine_in_ten_is_refuted_is_noted_with_its_interval(
    stubbed: type[StubPool], monkeypatch: pytest.MonkeyPatch
) -> None:
    def bound(self: StubPool, system: System) -> float:  # the more is lost, the fewer of the 29 seeds are good
        return 1.0 if system.seed % 29 < 100.0 * (at(system, "timing.loss") - 0.26) else 0.01

    monkeypatch.setattr(stubbed, "bound", bound)
    found = limits.limit(scenario_of(), "loss")
    assert found.large_signal_limit == pytest.approx(0.26, abs=0.01)
    assert found.refuted_limit == pytest.approx(0.32, abs=0.011)  # 6 failures of 29 are not enough, 7 are
    by_value = {one.value: one for one in found.tried}[found.refuted_limit or 0.0]
    assert (by_value.flew, by_value.runs) == (22, 29)
    assert by_value.share == wilson(22, 29)
    assert "22 of 29 seeds are good, a share of 0.58 to 0.88" in "\n".join(found.notes)
    heads, *rows = shares_as_text(found)
    assert heads == ["loss", "good of 29", "share [95 % Wilson interval]"]
    assert ["0.25", "29", "1.00 [0.88, 1.00]"] in rows
    assert len(rows) == len(found.tried), "also the values at which only the first seeds were run"
    assert ["0.265", "0 of the first 1", "-"] in rows
    assert as_text(found)["tried"] == f"{len(found.tried)} values"
    passed = {one.value: one for one in found.tried}[0.25]
    assert (passed.flew, passed.share) == (29, wilson(29, 29))


def test_a_value_at_which_only_some_seeds_are_good_is_not_reported_as_good_above_the_limit(
    stubbed: type[StubPool], monkeypatch: pytest.MonkeyPatch
) -> None:
    def bound(self: StubPool, system: System) -> float:  # of the seeds one fails from .2 to .42, and all from .5 on
        loss = at(system, "timing.loss")
        return 1.0 if loss > 0.5 or (0.2 < loss < 0.42 and system.seed % 29 == 3) else 0.01

    monkeypatch.setattr(stubbed, "bound", bound)
    found = limits.limit(scenario_of(), "loss")
    some = [one.value for one in found.tried if 0 < one.flew < one.runs == found.seeds]
    assert found.large_signal_limit == pytest.approx(0.2, abs=0.01)
    assert some
    assert not {*some} & {*found.flies_above}
    assert found.flies_above == tuple(one.value for one in found.tried if one.value > 0.42 and one.flew == 29)
    assert found.flies_above


def test_the_interval_of_a_share_is_at_the_requested_confidence(
    stubbed: type[StubPool], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(stubbed, "bound", lambda self, system: 1.0 if at(system, "timing.loss") > 0.3 else 0.01)
    found = limits.limit(scenario_of(), "loss", confidence=0.5)
    shares = {one.share for one in found.tried if one.flew == found.seeds}
    assert shares == {wilson(found.seeds, found.seeds, 0.5)}
    assert wilson(found.seeds, found.seeds, 0.5) != wilson(found.seeds, found.seeds)


def test_a_first_value_that_fails_for_some_seeds_may_still_be_good_for_nine_in_ten(
    stubbed: type[StubPool], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(stubbed, "bound", lambda self, system: 1.0 if system.seed == 3 else 0.01)
    found = limits.limit(scenario_of(), "loss")
    assert (found.large_signal_limit, found.refuted_limit) == (None, None)
    assert found.tried[0].share == wilson(28, 29)


def test_near_continuous_time_no_digital_effects_remain(stubbed: type[StubPool]) -> None:
    base = scenario_of(
        period=0.02, delay=0.005, command_loss=0.1, hold="first", order="jacobi", noise={"position": 0.1}
    )
    base = base.with_changes(parameters={"plant.mass": 1.0, "plant.actuator_time_constant": 0.02})
    found = limits.limit(base, "delay", continuous=True)
    (ideal,) = [flown for flown in stubbed.systems if at(flown, "timing.period") == 1e-4]
    clear = dataclasses.replace(
        base, timing=Timing(period=1e-4, plant_interval=0.02), record=Record(plant=(), controller=())
    )
    assert ideal == clear.as_system()
    assert found.continuous == ContinuousRun(period=1e-4, outcome="settled", settling_time=1.5)
    assert limits.limit(base, "delay").continuous is None


def test_the_limit_at_the_edge_of_the_boundary_layer_stands_beside_the_other(stubbed: type[StubPool]) -> None:
    del stubbed
    found = limits.limit(scenario_of().with_changes(parameters={"controller.surface_exponent": 0.5}), "period")
    assert (found.local_limit, found.local_limit_outside) == pytest.approx((0.0801, 0.0085), abs=1e-4)


@pytest.mark.usefixtures("stubbed")
def test_where_nothing_is_random_one_run_decides_and_there_is_no_confidence() -> None:
    found = limits.limit(scenario_of(), "period")
    assert (found.seeds, found.confidence) == (1, None)


@pytest.mark.usefixtures("stubbed")
def test_each_value_is_announced() -> None:
    lines: list[str] = []
    limits.limit(scenario_of(), "period", announce=lines.append)
    assert lines[0] == "engine compiled: native FMUs, one run at a time"
    assert lines[1] == "period 10 ms: settled"
    assert "period 1 ms: settled" in lines
    assert "period 30 ms: settled" in lines
    assert "period 35 ms: fails, bounded: ultimate_bound = 1 m, expected < 0.05 m" in lines


@pytest.mark.usefixtures("stubbed")
@pytest.mark.parametrize("of", ["period", "jitter"])
def test_progress_is_a_share_of_the_longest_search_and_reaches_one(of: str) -> None:
    shares: list[float] = []
    found = limits.limit(scenario_of(), of, progress=shares.append)
    assert len(shares) > len(found.tried)
    assert 0.0 < shares[0] < 0.1
    assert all(0.0 < share <= 1.0 for share in shares)
    assert shares[-1] == 1.0


@pytest.mark.usefixtures("stubbed")
def test_a_mass_mismatch_has_no_local_limit_with_the_reason_noted() -> None:
    found = limits.limit(scenario_of().with_changes(parameters={"controller.mass": 1.1}), "period")
    assert found.local_limit is None
    assert found.large_signal_limit is not None
    assert "hover is no equilibrium" in "\n".join(found.notes)
    assert all(len(note.splitlines()) == 1 for note in found.notes)


def test_find_runs_the_scenario_and_its_result_is_json() -> None:
    base = dataclasses.replace(hover_of(short(stop_time=2.0, plant_interval=0.01)), stop_time=2.0)
    base = base.with_changes(parameters={"plant.initial.position.x": 0.005})
    found = limits.limit(base, "period", tolerance=0.02)
    fields = json.loads(json.dumps(dataclasses.asdict(found)))
    assert fields.keys() == {
        "of", "unit", "judged", "judged_unit", "judged_bound", "local_limit", "local_method", "local_accuracy",
        "local_limit_outside", "local_lower_limit", "mean_square_limit", "large_signal_limit",
        "large_signal_lower_limit", "refuted_limit", "missed_deadlines_from", "missed_by", "follows", "horizon",
        "tolerance", "scan", "geometric", "confidence", "seeds", "flies_above", "continuous", "tried", "notes",
    }  # fmt: skip
    limit = found.large_signal_limit
    assert limit is not None
    assert is_good(quadcosim.run(base.with_changes(timing={"period": limit})).metrics)
    assert fields["local_limit"] == pytest.approx(0.080, abs=0.0005)
    assert (fields["of"], fields["tolerance"], fields["confidence"]) == ("period", 0.02, None)
    assert (fields["horizon"], fields["scan"], fields["continuous"]) == (2.0, 0.005, None)
    assert [one["value"] for one in fields["tried"]][:5] == [0.001, 0.002, 0.003, 0.004, 0.005]
    assert 0.0 < fields["tried"][0].pop("measured") < 0.005
    assert fields["tried"][0] == {
        "value": 0.001, "outcome": "settled", "divergence_time": None, "flew": 1, "runs": 1, "share": None,
        "unmet": None,
    }  # fmt: skip


@pytest.mark.parametrize("workers", sample([1, 2], 1))
def test_find_of_a_random_quantity_is_the_same_with_any_number_of_workers(workers: int) -> None:
    base = dataclasses.replace(hover_of(short()), stop_time=0.05)
    found = limits.limit(base, "loss", confidence=0.2, scan=0.25, tolerance=0.5, workers=workers)
    assert (found.seeds, found.large_signal_limit) == (3, None)
    assert "good throughout the scan, up to 1" in found.verdict


@pytest.mark.parametrize(
    ("options", "expected"),
    [
        ({"of": "mass"}, "of = mass: expected one of period, delay, jitter, loss, or a path"),
        ({"tolerance": 0.0}, "tolerance = 0.0: expected a positive number"),
        ({"tolerance": -1.0}, "tolerance = -1.0: expected a positive number"),
        ({"tolerance": math.nan}, "tolerance = nan: expected a positive number"),
        ({"scan": 0.0}, "scan = 0.0: expected a positive number"),
        ({"scan": math.inf}, "scan = inf: expected a positive number"),
        ({"of": "loss", "last": 1.52}, "last = 1.52: .*loss = 1.52: expected a probability in"),
        ({"confidence": 0.0}, "confidence = 0.0: expected a number between 0 and 1"),
        ({"confidence": 1.0}, "confidence = 1.0: expected a number between 0 and 1"),
        ({"confidence": math.nan}, "confidence = nan: expected a number between 0 and 1"),
    ],
)
def test_invalid_requests_are_refused_before_any_run(
    stubbed: type[StubPool], options: dict[str, Any], expected: str
) -> None:
    stubbed.systems = []
    with pytest.raises(UsageError, match=expected):
        limits.limit(scenario_of(), **{"of": "period", **options})
    assert stubbed.systems == []


def test_after_an_interruption_of_the_theory_the_flown_limit_remains_with_what_is_missing(
    stubbed: type[StubPool], monkeypatch: pytest.MonkeyPatch
) -> None:
    def stopped(*given: object) -> LinearLimit:
        raise KeyboardInterrupt

    monkeypatch.setattr(limits, "local_limits", stopped)
    monkeypatch.setattr(stubbed, "bound", lambda self, system: 0.01 if at(system, "timing.period") < 0.0334 else 1.0)
    with pytest.raises(LimitInterrupted, match="before all limits by linear theory were found") as stop:
        limits.limit(scenario_of(), "period")
    assert stop.value.result.large_signal_limit == pytest.approx(0.033, abs=5e-4)
    assert "no local limit: interrupted before the limits by linear theory" in stop.value.result.notes
