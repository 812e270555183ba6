"""Costs and mean-square limits that are known, from hand-made matrices."""

import math
from typing import Any

import numpy as np
import pytest
from scipy.sparse.linalg import LinearOperator, eigs

from orchestration.foundation.basics.bisection import bisected
from orchestration.systems.system.component import Component, Sampling
from orchestration.systems.system.connection import Connection
from orchestration.systems.system.distribution import Distribution
from orchestration.systems.system.model import System
from orchestration.theory.exact import random_times
from orchestration.theory.stability.matrices import Components, Continuous, SampledSystem
from tests.orchestration.theory.exact.common import GAIN, SERVO_PERIOD, integrator, loop, servo


def test_the_cost_of_minimum_variance_control_is_that_of_theory() -> None:
    assert integrator().costs()[0] == pytest.approx((3.0 + math.sqrt(3.0)) / 6.0, abs=1e-12)


@pytest.mark.parametrize("nodes", [3, 6])
def test_with_a_uniform_delay_it_is_that_of_three_nodes_of_gauss(nodes: int) -> None:
    assert integrator(nodes=nodes, delay_jitter=0.5).costs()[0] == pytest.approx(1.2186963044, abs=1e-10)


@pytest.mark.parametrize(("delay", "expected"), [(0.0, 65.5234406988), (0.003, 86.2175992472), (0.006, 123.022639193)])
def test_the_servo_costs_what_jitterbug_says(delay: float, expected: float) -> None:
    """Of its table, where each of two delays is half of it."""
    assert servo(delay=delay).costs()[0] / SERVO_PERIOD == pytest.approx(expected, rel=1e-11)


@pytest.mark.parametrize(("longest", "expected"), [(10, 74.720524553), (20, 86.5141979439)])
def test_with_two_delays_out_of_eleven_or_more_values_the_servo_costs_what_jitterbug_says(
    longest: int, expected: float
) -> None:
    """Two independent delays of 0, 0.15, … ms: the controller is static, so their sum may be one delay."""
    count = longest + 1
    ways = [min(k, 2 * longest - k) + 1 for k in range(2 * longest + 1)]
    delay = Distribution(
        values=tuple(0.00015 * k for k in range(2 * longest + 1)), probabilities=tuple(n / count**2 for n in ways)
    )
    assert servo(delay=delay).costs()[0] / SERVO_PERIOD == pytest.approx(expected, rel=1e-10)


def test_a_delay_and_a_jitter_on_top_that_are_both_drawn_make_their_sum() -> None:
    each = Distribution(values=tuple(0.00015 * k for k in range(11)))
    assert servo(delay=each, delay_jitter=each).costs()[0] / SERVO_PERIOD == pytest.approx(74.720524553, rel=1e-10)


def test_a_long_table_costs_what_its_values_do_one_by_one() -> None:
    """By Gauss's rule of the table, which is exact for powers of the delay up to the nineteenth."""
    values = tuple(0.0005 + 0.003 * (k / 60.0) ** 2 for k in range(61))
    by_rule = servo(nodes=10, delay=Distribution(values=values)).costs()[0]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(random_times, "FEW", len(values))
        one_by_one = servo(delay=Distribution(values=values)).costs()[0]
    assert by_rule == pytest.approx(one_by_one, rel=1e-11)


def test_with_a_fifth_of_the_commands_lost_the_cost_is_the_exact_one_and_fourth_moments_have_no_end() -> None:
    lossy = integrator(loss=0.2)
    assert lossy.costs()[0] == pytest.approx(5.887, abs=5e-4)
    assert lossy.fourth_moment_radius is not None
    assert lossy.fourth_moment_radius > 1.0


def test_fourth_moments_have_no_end_from_eight_percent_of_loss_on() -> None:
    below, above = (integrator(loss=p).fourth_moment_radius for p in (0.0826, 0.0827))
    assert below is not None
    assert above is not None
    assert below < 1.0 < above


def test_radii_of_a_loop_without_chance_are_powers_of_the_spectral_radius() -> None:
    steady = integrator()
    assert steady.radius == pytest.approx((1.0 - GAIN) ** 2, abs=1e-14)
    assert steady.fourth_moment_radius == pytest.approx((1.0 - GAIN) ** 4, abs=1e-14)


@pytest.mark.parametrize(
    ("burst", "limit"), [(None, 0.2240092377), (1.5, 0.1924500897), (2.0, 0.1443375673), (4.0, 0.0721687836)]
)
def test_the_mean_square_limit_of_losses_is_that_of_theory(burst: float | None, limit: float) -> None:
    def fails(loss: float) -> bool:
        return integrator(loss=loss, burst_length=burst).radius >= 1.0

    found = bisected(fails, 0.02, 0.4, 1e-11)
    assert 0.5 * (found.good + found.bad) == pytest.approx(limit, abs=1e-9)


@pytest.mark.parametrize(("samples", "scale"), [(3, 0.1), (60, 0.006)])
def test_losses_before_a_long_delay_cost_what_two_matrices_say(samples: int, scale: float) -> None:
    """Of x and the commands that were sent last at each of the samples before, newest first."""
    n, p, gain = samples + 2, 0.2, scale * GAIN
    moves = np.eye(n, k=-1)
    moves[0, [0, samples]], moves[1, 0] = 1.0, 0.0
    arrives, lost = moves.copy(), moves.copy()
    arrives[1, 0], lost[1, 1] = -gain, 1.0
    mean = (1.0 - p) * arrives + p * lost
    differs = (arrives - lost)[1]  # all of which is in the newest command, so one number of it remains unknown

    def sums(added: np.ndarray) -> np.ndarray:
        found, turn = added, mean
        for _ in range(20):
            found, turn = found + turn @ found @ turn.T, turn @ turn
        return found

    by_noise, by_chance = sums(np.diag(np.eye(n)[0])), p * (1.0 - p) * sums(np.diag(np.eye(n)[1]))
    moments = by_noise + differs @ by_noise @ differs / (1.0 - differs @ by_chance @ differs) * by_chance
    x, u = 0, samples
    cost = moments[x, x] + moments[x, u] + moments[u, u] / 3.0 + 0.5
    lossy: dict[str, Any] = {"delay": float(samples), "loss": p}
    commanded, measured = integrator(scale=scale, **lossy), integrator(scale=scale, measurement=lossy)
    assert commanded.costs()[0] == pytest.approx(cost, rel=1e-11)
    assert measured.costs()[0] == pytest.approx(cost, rel=1e-11)  # of a static law a late measurement is a late command
    assert 1.0 > commanded.radius >= np.abs(np.linalg.eigvals(mean)).max() ** 2


@pytest.mark.parametrize(
    "changes",
    [
        {"delay": 0.3, "delay_jitter": 0.9},
        {"delay": 0.2, "sampling": {"jitter": 0.3}},
        {"delay": 0.7, "order": "jacobi"},
        {"delay_jitter": 0.4, "jitter_distribution": "normal"},
    ],
    ids=["over a period", "jitter of samples", "the end of the step", "normal"],
)
def test_twice_the_order_of_gauss_s_rule_changes_nothing_where_no_message_can_overtake(changes: dict[str, Any]) -> None:
    low, high = (integrator(nodes=nodes, **changes) for nodes in (10, 20))
    assert low.radius == pytest.approx(high.radius, rel=1e-10)
    if low.radius < 1.0:
        assert low.costs()[0] == pytest.approx(high.costs()[0], rel=1e-10)


def test_a_command_that_arrives_at_a_sample_acts_on_what_is_measured_at_the_next_one() -> None:
    """x' = u with y = x + D u under u = -k y, a period late: y of a sample has the command before the one arriving."""
    k, D = 0.3, 0.5
    system = System(
        stop_time=10.0,
        components={
            "plant": Component(fmu="plant.fmu", step=0.1),
            "law": Component(fmu="law.fmu", sampling=Sampling(period=1.0)),
        },
        connections=(
            Connection(name="measurement", start=("plant.y",), end=("law.y",)),
            Connection(name="command", start=("law.u",), end=("plant.u",), delay=1.0),
        ),
    )
    empty = np.zeros((0, 0))
    components: Components = {
        "plant": Continuous(
            inputs=("u",), outputs=("y",), A=np.zeros((1, 1)), B=np.eye(1), C=np.eye(1), D=np.full((1, 1), D)
        ),
        "law": SampledSystem(
            inputs=("y",), outputs=("u",), A=empty, B=np.zeros((0, 1)), C=np.zeros((1, 0)), D=np.array([[-k]])
        ),
    }
    by_hand = np.array([[1.0, 1.0, 0.0], [-k, 0.0, -k * D], [0.0, 1.0, 0.0]])  # of x, u one period ago, and two
    radius = np.abs(np.linalg.eigvals(by_hand)).max()
    assert loop(system, components, {}, ("plant.u",), nodes=1).radius == pytest.approx(radius**2, rel=1e-9)


def test_bursts_behind_a_long_line_cost_what_two_maps_in_turn_do(monkeypatch: pytest.MonkeyPatch) -> None:
    """Commands 50 samples late, a fifth of them lost in bursts of three: moments by whether the last one was lost."""
    late, gain, lost, burst = 50, 0.008, 0.2, 3.0
    monkeypatch.setattr("tests.orchestration.theory.exact.common.GAIN", gain)
    found = integrator(delay=float(late), loss=lost, burst_length=burst)
    rows = np.eye(late + 2)  # x, the command, those on their way, the newest first
    turns = [
        np.vstack([rows[0] + rows[-1], rows[-1], newest, rows[2:-1]])
        for newest in (-gain * rows[0], rows[2])  # one that is lost is as the one before
    ]
    ends, begins = 1.0 / burst, lost / (burst * (1.0 - lost))
    chance, shares = np.array([[1.0 - begins, begins], [ends, 1.0 - ends]]), (1.0 - lost, lost)

    def later(P: Any, noise: float) -> Any:
        """The moments a second later, by whether the last command is lost, with a density of noise."""
        mixed = np.einsum("ij,ikl->jkl", chance, P)
        return np.array([T @ M @ T.T + noise * q * np.outer(rows[0], rows[0]) for T, M, q in zip(turns, mixed, shares)])

    moments = np.zeros((2, late + 2, late + 2))
    for _ in range(1000):
        moments = later(moments, 1.0)
    P = moments.sum(axis=0)
    assert found.costs()[0] == pytest.approx(P[0, 0] + P[0, -1] + P[-1, -1] / 3.0 + 0.5, rel=1e-8)
    alone = LinearOperator(
        (P.size * 2, P.size * 2), lambda x: later(x.reshape(moments.shape), 0.0).ravel(), dtype=float
    )
    (largest,) = eigs(alone, k=1, which="LR", v0=np.array([rows, rows]).ravel(), ncv=80, return_eigenvectors=False)
    assert found.radius == pytest.approx(largest.real, rel=1e-8)
