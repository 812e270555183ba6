"""The command that the controller FMU must give, from the law called directly."""

from collections.abc import Mapping

from controller_fmu.sliding_mode.law import Gains, evaluate
from controller_fmu.vehicle import Measurement, Model
from fmu_kit.algebra import Quaternion, Vec3
from fmu_kit.trajectory import Trajectory

MEASUREMENT = {
    "position.x": 0.3,
    "position.y": -0.2,
    "position.z": 1.7,
    "velocity.x": 0.1,
    "velocity.y": 0.4,
    "velocity.z": -0.3,
    "quaternion.x": 0.1,
    "quaternion.y": -0.2,
    "quaternion.z": 0.05,
    "quaternion.w": 0.95,
    "angular_velocity.x": 0.2,
    "angular_velocity.y": -0.1,
    "angular_velocity.z": 0.3,
}
"""A measurement away from every special case; the quaternion is not of unit length."""

COMMAND = ("thrust", "torque.x", "torque.y", "torque.z")


def law_command(t: float, measurement: Mapping[str, float] = MEASUREMENT) -> list[float]:
    """Thrust [N] and torque [N.m] at `t` [s] for a measurement, the built-in trajectory and default parameters."""

    def vector(name: str) -> Vec3:
        return Vec3(*(measurement[f"{name}.{axis}"] for axis in "xyz"))

    quaternion = Quaternion(vector("quaternion"), measurement["quaternion.w"]).normalised()
    state = Measurement(vector("position"), vector("velocity"), quaternion, vector("angular_velocity"))
    evaluation = evaluate(state, Trajectory().at(t), Gains(), Model())
    return [evaluation.thrust, *evaluation.torque]
