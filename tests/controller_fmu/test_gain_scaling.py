"""Gains per unit inertia: one set gives every vehicle the same path."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from controller_fmu.geometric import law as geometric
from controller_fmu.sliding_mode import law as sliding_mode
from controller_fmu.vehicle import Measurement, Model
from fmu_kit.algebra import ZERO, Inertia, Quaternion
from fmu_kit.integrator import rk4_step
from fmu_kit.rigid_body import RigidState, Wrench, derivative
from fmu_kit.trajectory import Trajectory

VEHICLES = {
    "the paper's": Model(),
    "of a few grams": Model(mass=0.029, inertia=Inertia(xx=16.57e-6, yy=16.66e-6, zz=29.26e-6)),
    "heavy": Model(mass=4.34, inertia=Inertia(xx=0.0820, yy=0.0845, zz=0.1377)),
    "with axes of its own": Model(mass=1.3, inertia=Inertia(xx=0.8, yy=0.9, zz=1.4, xy=0.05, xz=-0.2, yz=0.3)),
}
LAWS: tuple[Any, ...] = (sliding_mode, geometric)
GAINS = {law: law.Gains(per_inertia=True) for law in LAWS}
START = RigidState(ZERO, ZERO, Quaternion.from_xyzw(0.1699, 0.3058, 0.1699, 0.9212).normalised(), ZERO)
STEP = 0.01
"""[s]"""


def flight(law: Any, gains: Any, model: Model) -> Any:
    """State and energy every fifth step over 3 s of the closed loop in continuous time, without wind."""
    trajectory, x, rows = Trajectory(), START, []

    def now(t: float, x: RigidState) -> Any:
        measurement = Measurement(x.position, x.velocity, x.quaternion, x.angular_velocity)
        return law.evaluate(measurement, trajectory.at(t), gains, model)

    def motion(t: float, x: RigidState) -> RigidState:
        evaluation = now(t, x)
        return derivative(x, Wrench(evaluation.thrust, evaluation.torque), ZERO, model)

    for k in range(300):
        if k % 5 == 0:
            rows.append([*x.position, *x.velocity, *x.quaternion, *x.angular_velocity, now(k * STEP, x).energy])
        x = rk4_step(motion, k * STEP, x, STEP).normalised()
    return np.array(rows)


@pytest.mark.parametrize("law", GAINS, ids=["unified", "geometric"])
def test_ideal_flights_of_all_vehicles_are_the_same_path_with_the_same_energy(law: Any) -> None:
    first, *others = (flight(law, GAINS[law], model) for model in VEHICLES.values())
    assert np.linalg.norm(first[-1, :3] - [*Trajectory().position(2.95)]) < 0.5  # it flies
    for rows in others:
        assert np.abs(rows - first).max() < 1e-9


@pytest.mark.parametrize("law", GAINS, ids=["unified", "geometric"])
def test_for_the_papers_vehicle_both_scalings_are_one_to_the_bit(law: Any) -> None:
    measurement = Measurement(START.position, START.velocity, START.quaternion, START.angular_velocity)
    reference = Trajectory().at(0.3)
    scaled = law.evaluate(measurement, reference, GAINS[law], Model())
    absolute = law.evaluate(measurement, reference, replace(GAINS[law], per_inertia=False), Model())
    assert (scaled.torque, scaled.energy) == (absolute.torque, absolute.energy)
