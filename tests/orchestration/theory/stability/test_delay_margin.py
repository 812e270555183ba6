"""Delay margins of unstable plants, and of laws whose gains differ by sample, against maps worked out apart."""

import dataclasses
import math

import numpy as np
import pytest
from scipy.linalg import expm

from orchestration.foundation.basics.errors import UsageError
from orchestration.foundation.basics.simulator import Floats
from orchestration.theory.stability import delay_margin as delay_margins
from orchestration.theory.stability.delay_margin import Late, delay_margin
from orchestration.theory.stability.linearise import Linearised
from orchestration.theory.stability.loop_halves import Sensitivity, radius, sensitivity_of
from orchestration.theory.stability.poles import Complexes
from orchestration.theory.stability.state_space import StateSpace

PLANT = np.array([[2.9, -3.2, -1.9], [-1.8, 2.6, 2.1]])
"""A plant with poles at 5.15 and 0.35 1/s: states by states and by the command"""
AGGRESSIVE = [[-6.35, 2.0]]
"""Its gain above 1 up to half the sampling rate, so that a pole leaves at -1, where no crossover is"""
SLOWER = np.array([[1.8, 0.9, -1.3], [0.4, 1.5, 0.1]])
FIVE = [[-5.2, -91.8], [12.8, 8.2], [-26.7, -77.1], [-47.2, -142.1], [-47.3, -143.1]]
"""Gains of five samples, which tolerate longer than crossovers of the curve of eigenvalues say"""


def held(plant: Floats, time: float) -> Floats:
    return np.asarray(expm(np.vstack([plant, np.zeros(3)]) * time))[:2]


def sample(plant: Floats, dt: float, whole: int, part: float) -> Floats:
    """The states after a sample by states, the commands before it, the newest first, and the one of it."""
    before, after = held(plant, part), held(plant, dt - part)
    found = np.zeros((2, 4 + whole))
    found[:, :2] = after[:, :2] @ before[:, :2]
    commands = [3 + whole, *range(2, 3 + whole)]  # of this sample, and of those before
    found[:, [commands[whole + 1]]] += after[:, :2] @ before[:, 2:]
    found[:, [commands[whole]]] += after[:, 2:]
    return found


def radius_late(plant: Floats, gains: list[list[float]], dt: float, delay: float) -> float:
    whole = math.floor(delay / dt + 1e-7)
    moved, size = sample(plant, dt, whole, max(0.0, delay - whole * dt)), 3 + whole
    period = np.eye(size)
    for gain in gains:
        sent = np.zeros((1, size))
        sent[0, :2] = -np.array(gain)
        one = np.vstack([moved[:, :size] + moved[:, size:] @ sent, sent, np.eye(size)[2:-1]])
        period = one @ period
    return float(np.abs(np.linalg.eigvals(period)).max())


def loop_of(plant: Floats, gains: list[list[float]], dt: float) -> tuple[Linearised, Late]:
    samples = len(gains)

    def rest(part: float) -> StateSpace:
        moved = sample(plant, dt, 0, part)
        A, B = np.vstack([moved[:, :3], np.zeros(3)]), np.vstack([moved[:, 3:], [[1.0]]])
        powers, C = [np.linalg.matrix_power(A, k) for k in range(samples + 1)], np.eye(2, 3)
        D = np.zeros((2 * samples, samples))
        for later, sooner in zip(*np.tril_indices(samples, -1)):
            D[2 * later : 2 * later + 2, [sooner]] = C @ powers[later - sooner - 1] @ B
        return StateSpace(
            A=powers[samples], B=np.hstack([power @ B for power in powers[samples - 1 :: -1]]),
            C=np.vstack([C @ power for power in powers[:samples]]), D=D, dt=samples * dt, inputs=("",) * samples,
            outputs=("",) * 2 * samples,
        )  # fmt: skip

    given = np.zeros((samples, 2 * samples))
    for k, gain in enumerate(gains):
        given[k, 2 * k : 2 * k + 2] = -np.array(gain)
    law = StateSpace(
        A=np.zeros((0, 0)), B=np.zeros((0, 2 * samples)), C=np.zeros((samples, 0)), D=given, dt=samples * dt,
        inputs=("",) * 2 * samples, outputs=("",) * samples,
    )  # fmt: skip
    loop = Linearised(
        name="law", component=law, rest=rest(0.0), operating_point={}, samples=samples, radius=0.0, poles=()
    )
    return dataclasses.replace(loop, radius=radius(loop)), Late(rest=rest)


@pytest.mark.parametrize(
    ("plant", "gains", "dt", "about"), [(PLANT, AGGRESSIVE, 0.1, 0.037), (SLOWER, FIVE, 0.01, 0.053)]
)
def test_the_delay_margin_is_the_first_delay_at_which_the_map_is_unstable(
    plant: Floats, gains: list[list[float]], dt: float, about: float
) -> None:
    loop, late = loop_of(plant, gains, dt)
    assert loop.radius == pytest.approx(radius_late(plant, gains, dt, 0.0), rel=1e-9)
    half = math.pi / loop.rest.dt
    found = delay_margin(loop, 0, np.geomspace(1e-4 * half, half, 500), late)
    assert found == pytest.approx(about, rel=0.1)
    assert found is not None
    sooner = np.linspace(0.0, found - 2e-9, 100)
    assert max(radius_late(plant, gains, dt, delay) for delay in sooner) < 1.0
    assert radius_late(plant, gains, dt, found + 2e-9) > 1.0


def test_a_margin_of_many_samples_is_found_between_frequencies_far_apart() -> None:
    plant, gains = np.array([[0.0, 1.0, 0.0], [0.0, -50.0, 50.0]]), [[1.0, 0.0]]
    loop, late = loop_of(plant, gains, 0.01)
    half = math.pi / loop.dt
    found = delay_margin(loop, 0, np.geomspace(1e-3 * half, half, 30), late)
    assert found is not None
    assert radius_late(plant, gains, 0.01, found - 1e-6) < 1.0 < radius_late(plant, gains, 0.01, found + 1e-6)


@pytest.mark.parametrize("lowest", [1e-3, 1e-8])
def test_frequencies_of_several_samples_are_not_refined_for_gains_that_are_large_beside_others(
    lowest: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Those of a double integrator at low frequencies, whose samples together have a large gain in one direction.

    At the lowest its inverse is beyond what rounding leaves.
    """
    points = list[int]()

    def counted(loop: Linearised, i: int) -> Sensitivity:
        def sensitivity(frequencies: Floats) -> Complexes:
            points.append(len(frequencies))
            return sensitivity_of(loop, i)(frequencies)

        return sensitivity

    monkeypatch.setattr(delay_margins, "sensitivity_of", counted)
    plant, gains, dt = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]), [[1.0, 1.4]] * 3, 0.05
    loop, late = loop_of(plant, gains, dt)
    half = math.pi / loop.rest.dt
    found = delay_margin(loop, 0, np.geomspace(lowest * half, half, 100), late)
    assert found is not None
    assert radius_late(plant, gains, dt, found - 2e-9) < 1.0 < radius_late(plant, gains, dt, found + 2e-9)
    assert max(points) == 100


def test_a_return_difference_that_cannot_be_followed_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(delay_margins, "MOST_VALUES", 30)
    loop, late = loop_of(np.array([[0.0, 1.0, 0.0], [0.0, -50.0, 50.0]]), [[1.0, 0.0]], 0.01)
    half = math.pi / loop.dt
    with pytest.raises(UsageError, match="changes too fast over the frequency to be followed"):
        delay_margin(loop, 0, np.geomspace(1e-3 * half, half, 31), late)
