"""The examples give the known answers of their problems, each to the stated accuracy.

Their slaves are written out as C, which `test_native` shows to make the runs that they make in Python.
"""

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.linalg import expm

from examples.lqg import design as lqg
from orchestration.experiments.limits import limit
from orchestration.simulation.runs.simulation import run
from orchestration.systems.system.component import Sampling
from orchestration.systems.system.connection import Connection
from orchestration.systems.system.distribution import Distribution
from orchestration.systems.system.files import files_of
from orchestration.systems.system.model import Criterion, System
from orchestration.systems.system.paths import changed
from orchestration.theory.exact.expect import expect, expected_of
from orchestration.theory.exact.loops import Loops
from quadcosim import UsageError, bode, linearise
from tests.examples.common import native_example as example
from tests.extent import sample

PERIOD = "components.controller.sampling.period"
COMMAND_DELAY = "connections.command.delay"


def limits(system: System, of: str, near: float, **options: Any) -> tuple[float, float]:
    """The results of `quadcosim limit` for a range around a value: the limit by runs, and the local one."""
    found = limit.limit(system, of, first=0.97 * near, last=1.03 * near, scan=0.03 * near, **options)
    assert found.large_signal_limit is not None
    assert found.local_limit is not None
    return found.large_signal_limit, found.local_limit


@pytest.mark.parametrize("k_d", sample([1.0, 1.4], 1))
def test_double_integrator_has_the_largest_period_of_theory(k_d: float) -> None:
    """min(2/k_d, 2 k_d/k_p): by runs within 0.5 %, as 240 s must show it; the local limit within 1e-5."""
    system = example("double_integrator", {"components.controller.parameters.k_d": k_d})
    expected = min(2.0 / k_d, 2.0 * k_d)
    large, local = limits(system, PERIOD, expected, tolerance=0.002)
    assert large == pytest.approx(expected, rel=0.005)
    assert local == pytest.approx(expected, rel=1e-5)


def test_double_integrator_has_the_largest_delay_of_theory() -> None:
    """0.68614 s at a period of 0.05 s, within 0.2 %: the tolerance of 1 ms; plant and samples are exact."""
    found = limits(example("double_integrator", {"stop_time": 120.0}), COMMAND_DELAY, 0.686, tolerance=1e-3)
    assert found == pytest.approx((0.68614, 0.68614), rel=2e-3)


WIRE = {f"connections.command.{key}": 0.0 for key in ("delay_jitter", "loss")}


def test_servo_has_the_largest_delay_of_theory() -> None:
    """13.497 ms: by runs within 0.2 %, the tolerance of 0.02 ms; the local limit within 0.02 %, its accuracy."""
    large, local = limits(example("dc_servo", WIRE), COMMAND_DELAY, 0.0135, tolerance=2e-5)
    assert large == pytest.approx(0.013497, rel=2e-3)
    assert local == pytest.approx(0.013497, rel=2e-4)


def test_servo_decays_with_the_spectral_radius_of_theory() -> None:
    """0.9324 at a delay of 2 ms, to its four digits: after 40 samples two pairs of modes are left."""
    signals = run(example("dc_servo", {**WIRE, COMMAND_DELAY: 0.002, "stop_time": 0.9})).signals
    time, angle = np.asarray(signals["time"]), np.asarray(signals["servo.angle"])
    sampled = angle[np.isclose(time / 0.006, np.round(time / 0.006), atol=1e-6)][40:140]
    past = np.stack([sampled[i : len(sampled) - 4 + i] for i in range(4)], axis=1)
    size = np.abs(sampled[4:])
    coefficients = np.linalg.lstsq(past / size[:, None], sampled[4:] / size, rcond=None)[0]
    radius = np.abs(np.roots([1.0, *-coefficients[::-1]])).max()
    assert radius == pytest.approx(0.9324, abs=5e-5)


def motor_radius(period: float, late: float = 0.0) -> float:
    """The spectral radius of the motor under its cascade over five samples, commands late by whole and part samples."""
    motor = np.array([[-1e3, -50.0, 1e3], [500.0, -0.1, 0.0], [0.0, 0.0, 0.0]])
    whole = math.floor(late / period)
    before, after = (expm(motor * time)[:2] for time in (late - whole * period, (whole + 1) * period - late))
    state = np.eye(6 + whole)  # current, speed, what the speed wants, two integrals, commands, the newest first
    for k in range(5):
        (current, speed, wanted, of_current, of_speed), sent = state[:5], state[5:]
        if k == 0:
            of_speed = of_speed - 20.0 * 1e-3 * speed
            wanted = of_speed - 0.4 * speed
        of_current = of_current + 1e3 * 2e-4 * (wanted - current)
        sent = np.vstack([wanted - current + of_current, sent])
        moved = before @ np.vstack([current, speed, sent[whole + 1]])
        state = np.vstack([after @ np.vstack([moved, sent[whole]]), wanted, of_current, of_speed, sent[:-1]])
    return float(np.abs(np.linalg.eigvals(state)).max())


def test_motor_under_a_cascade_of_two_rates_has_the_margin_and_the_limit_of_its_matrices() -> None:
    system = example("dc_motor")
    (loop,) = bode(system).loops
    assert loop.delay_margin == pytest.approx(1.3549e-3, abs=1e-6)
    assert motor_radius(2e-4, loop.delay_margin - 1e-6) < 1.0 < motor_radius(2e-4, loop.delay_margin + 1e-6)
    for period in (0.0002, 0.0025130005):
        found = linearise(changed(system, {PERIOD: period})).radius
        assert found == pytest.approx(motor_radius(period), abs=1e-5)
    assert motor_radius(2.5136e-3) < 1.0 < motor_radius(2.5137e-3)


def mean_square_voltage(lost: float, forgotten: float, noise: float) -> float:
    """Of the motor under its cascade, and a law that wants -0.3 times the speed it sees 0.3 ms after each millisecond.

    Messages of cascade and law are lost with these probabilities. By second moments from tenth to tenth of a
    millisecond, of: current, speed, both as measured, the command, what law and speed want, two integrals, the voltage.
    """
    rows = np.eye(9)
    F = np.zeros((9, 9))
    F[0], F[1] = -1e3 * rows[0] - 50.0 * rows[1] + 1e3 * rows[4], 500.0 * rows[0] - 0.1 * rows[1]
    F *= 1e-4
    flow, measured, command, law = (np.eye(9) for _ in range(4))
    flow += F + F @ F / 2.0 + F @ F @ F / 6.0 + F @ F @ F @ F / 24.0
    measured[[2, 3]], law[5] = rows[[0, 1]], -0.3 * rows[1]
    speed, current = np.eye(9), np.eye(9)
    speed[8] = rows[8] + 20.0 * 1e-3 * (rows[5] - rows[3])
    speed[6] = speed[8] + 0.4 * (rows[5] - rows[3])
    current[7] = rows[7] + 1e3 * 2e-4 * (rows[6] - rows[2])
    voltage, sum_of_voltages, before = rows[6] - rows[2] + current[7], 0.0, -1.0
    command[4] = voltage
    command[7] = current[7]
    P: Any = np.zeros((9, 9))
    while abs(sum_of_voltages - before) > 1e-13 * sum_of_voltages:
        before, sum_of_voltages = sum_of_voltages, 0.0
        for k in range(10):
            if k % 2 == 0:
                P = measured @ P @ measured.T + noise**2 * np.diag([0, 0, 1, 1, 0, 0, 0, 0, 0])
                P = speed @ P @ speed.T if k == 0 else P
                sum_of_voltages += voltage @ P @ voltage
                P = (1.0 - lost) * command @ P @ command.T + lost * current @ P @ current.T
            if k == 3:
                P = (1.0 - forgotten) * law @ P @ law.T + forgotten * P
            P = flow @ P @ flow.T
    return sum_of_voltages / 5.0


def test_motor_under_a_cascade_of_two_rates_with_losses_has_the_moments_of_its_matrices() -> None:
    motor = example("dc_motor")
    law = replace(
        example("minimum_variance").components["controller"],
        sampling=Sampling(period=0.001, offset=0.0003), parameters={"gain": 0.3},
    )  # fmt: skip
    measurement, command = motor.connections
    system = replace(
        motor,
        components={**motor.components, "law": law},
        connections=(
            replace(measurement, noise=dict.fromkeys(measurement.noise or ("current", "speed"), 0.01)),
            replace(command, loss=0.3),
            Connection(name="seen", start=("motor.speed",), end=("law.x",), stated=True),
            Connection(name="setpoint", start=("law.u",), end=("controller.wanted",), loss=0.4, stated=True),
        ),
        sources={}, operating_point={}, criterion=Criterion(), objectives={"voltage": "mean(controller.voltage**2)"},
    )  # fmt: skip
    found = expect(system, as_simulated=True)
    assert found.objectives["voltage"] == pytest.approx(mean_square_voltage(0.3, 0.4, 0.01), rel=1e-9)
    assert found.period == 0.001
    with pytest.raises(UsageError, match="horizon: the initial state of controller, code of several rates, is not"):
        expect(system, horizon=0.01, as_simulated=True)


@pytest.mark.parametrize(
    ("gain", "weight", "expected"),
    [
        (3.0 - math.sqrt(3.0), 0.0, (3.0 + math.sqrt(3.0)) / 6.0),
        (0.6 * (math.sqrt(13.0 / 3.0) - 1.0), 1.0, 1.540833),
    ],
    ids=["state", "state and command"],
)
def test_minimum_variance_control_has_the_cost_of_theory(gain: float, weight: float, expected: float) -> None:
    """Mean of x^2 (and u^2), in an interval of 99.9 % over eight seeds, which is narrower than 10 % of it.

    The noise is held for q = 0.1 s, at whose points x is as under white noise; the trapezoid over them adds
    q^2/6 P L^2 (P the variance at samples), 0.4 %.
    """
    found = []
    for seed in range(8):
        metrics = run(
            example("minimum_variance", {"seed": seed, "components.controller.parameters.gain": gain})
        ).metrics
        found.append(metrics["variance"] + weight * metrics["effort"])
    excess = 0.1**2 / 6.0 * gain**2 / (2.0 * gain - gain**2)
    half_width = 5.41 * np.std(found, ddof=1) / math.sqrt(len(found))
    assert half_width < 0.1 * expected
    assert abs(np.mean(found) - excess - expected) < half_width


SHORT, LONG = (tuple(0.00015 * k for k in range(count)) for count in (11, 21))
"""[s], of each of two delays"""


@pytest.mark.parametrize(
    ("delays", "expected"),
    [
        ((0.0,), 65.5234406988),
        ((0.0015,), 86.2175992472),
        (SHORT, 74.720524553),
        ((0.003,), 123.022639193),
        (LONG, 86.5141979439),
    ],
    ids=["none", "1.5 ms", "up to 1.5 ms", "3 ms", "up to 3 ms"],
)
def test_the_servo_over_two_networks_costs_what_jitterbug_says(delays: tuple[float, ...], expected: float) -> None:
    """Each delay on its own, to nine digits; both are drawn, one on top of the other."""
    each = Distribution(values=delays)
    system = example("distributed_servo", {COMMAND_DELAY: each, f"{COMMAND_DELAY}_jitter": each})
    found = expect(system).objectives["J"]
    assert found == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("delay", sample([0.03, 0.0, 0.1], 1))
def test_lqg_costs_what_its_riccati_equations_say(delay: float) -> None:
    """To nine digits, with what is between samples, for a late command that filter and gain are designed for."""
    found = expect(lqg.at(delay, gain_knows=True, filter_knows=True)).objectives["J"]
    assert found == pytest.approx(lqg.lqg(delay).cost, rel=1e-9)


@pytest.mark.parametrize("delay", sample([0.0, 0.05], 1))
def test_any_other_gain_or_filter_than_that_of_lqg_costs_more(delay: float) -> None:
    """One part in a hundred away along each of them, up and down: more by the second order of that alone."""
    best = lqg.at(delay, gain_knows=True, filter_knows=True)
    values = {**lqg.lqg(delay).gains, "omega": lqg.OMEGA}
    loops = Loops(files_of(best).models)

    def cost(changes: Mapping[str, Any]) -> float:
        found = expected_of(changed(best, changes), loops).objectives["J"]
        assert found is not None
        return found

    least = cost({})
    for name, value in sample([*values.items()], 2):
        size = 0.01 * max(0.1, abs(value))
        beside = [cost({f"{lqg.PARAMETERS}.{name}": value + sign * size}) for sign in (1, -1)]
        assert least < min(beside) < max(beside) < 1.01 * least


@pytest.mark.parametrize(("period", "delay"), sample([(0.07, 1.0), (0.5, 0.0), (0.1, 0.25), (0.25, 0.1)], 2))
def test_tank_rises_by_a_period_and_a_delay_above_the_switch_and_no_more(period: float, delay: float) -> None:
    """The bound 2 + (T + d) · 1 m/s is reached, but for the micrometre that the level lacks at a sample."""
    last = math.floor(2.0 / period) * period  # a sample at which the level is a micrometre below the switch
    changes = {
        PERIOD: period,
        "connections.valve.delay": delay,
        "components.tank.parameters.initial.level": 2 - 1e-6 - last,
    }
    peak = run(example("water_tank", changes)).metrics["peak"]
    assert peak == pytest.approx(2.0 + period + delay - 1e-6, abs=1e-9)


@pytest.mark.parametrize("level", [0.0, 0.013, 0.5, 0.77])
def test_tank_never_rises_above_the_bound(level: float) -> None:
    peak = run(example("water_tank", {"components.tank.parameters.initial.level": level})).metrics["peak"]
    assert 2.25 - 1e-9 <= peak <= 2.35 + 1e-9
