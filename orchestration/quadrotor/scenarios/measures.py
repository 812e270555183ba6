"""Quantities of a flight that figures and studies share with the objectives of the system file."""

from collections.abc import Mapping, Sequence

import numpy as np

from orchestration.foundation.basics.simulator import Booleans, Floats
from orchestration.quadrotor.scenarios.wiring import COMMAND, POSITION, POSITION_REFERENCE


def desired(signals: Mapping[str, Floats]) -> Floats:
    """P_d [m], inertial, shape (n, 3)."""
    return np.column_stack([signals[name] for name in POSITION_REFERENCE])


def position_error(signals: Mapping[str, Floats]) -> Floats:
    """‖P - P_d‖ [m], shape (n,)."""
    actual = np.column_stack([signals[f"plant.{name}"] for name in POSITION])
    return np.asarray(np.linalg.norm(actual - desired(signals), axis=1))


def saturated(signals: Mapping[str, Floats], parameters: Mapping[str, float]) -> dict[str, Booleans]:
    """For each command as the plant receives it, where a limit of the plant alters it, shape (n,) each.

    A limit of a motor alters all of them. A plant without parameters for limits has none.
    """
    thrust, *torques = (signals[f"plant.{name}"] for name in COMMAND)
    most_thrust, most_torque = (parameters.get(f"plant.{name}", np.inf) for name in ("thrust_max", "torque_max"))
    motors = _motors_saturated(thrust, torques, parameters)
    of_thrust = {COMMAND[0]: (thrust < parameters.get("plant.thrust_min", 0.0)) | (thrust > most_thrust) | motors}
    return of_thrust | {name: (np.abs(t) > most_torque) | motors for name, t in zip(COMMAND[1:], torques, strict=True)}


def _motors_saturated(thrust: Floats, torques: Sequence[Floats], parameters: Mapping[str, float]) -> Booleans:
    """Where any of four motors on an X frame would need a thrust outside its range."""
    most = parameters.get("plant.motor.thrust_max", 0.0)
    if most <= 0.0:
        return np.zeros(len(thrust), dtype=np.bool_)
    arm_x, arm_y, drag = (parameters[f"plant.motor.{name}"] for name in ("arm.x", "arm.y", "drag_to_thrust"))
    least, (x, y, z) = parameters.get("plant.motor.thrust_min", 0.0), torques
    motors = [
        thrust + turn * z / drag + way * (x / arm_y - turn * y / arm_x) for turn in (1.0, -1.0) for way in (1.0, -1.0)
    ]
    return np.asarray(np.any([(one > 4.0 * most) | (one < 4.0 * least) for one in motors], axis=0))
