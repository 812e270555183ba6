"""What a run comes to, as numbers."""

import math
from collections.abc import Mapping
from typing import Literal, get_args

import numpy as np
import numpy.typing as npt

from orchestration.simulator import Floats
from orchestration.wiring import ATTITUDE_ERROR_SCALAR, COMMAND, ENERGY, POSITION

SETTLED = 0.05
"""[m] of position error"""

Metrics = dict[str, float | int | bool | str | None]

Outcome = Literal["settled", "bounded", "diverged"]
"""What became of a flight by its horizon: settled is what counts as flying"""
OUTCOMES: tuple[Outcome, ...] = get_args(Outcome)


def compute(
    signals: Mapping[str, Floats],
    desired: Floats,
    sampled: npt.NDArray[np.bool_],
    *,
    thrust_max: float,
    torque_max: float,
) -> Metrics:
    """The metrics of `signals` (arrays of shape (n,) by column) against the `desired` positions (n, 3) [m].

    `sampled` marks the rows at which the controller sampled; limits are the plant's, in N and N·m.
    Commands are as applied to the plant, before its limits. Integrals are by the trapezoid rule over the rows.
    What is taken at samples is None without any; so is what no float holds.
    """
    t = signals["time"]
    e = position_error(signals, desired)
    thrust, *torque = (signals[f"plant.{name}"] for name in COMMAND)
    duration = float(t[-1] - t[0])
    limited = (thrust < 0.0) | (thrust > thrust_max) | (np.abs(torque) > torque_max).any(axis=0)
    with np.errstate(over="ignore"):  # a diverging run may end in squares that no float holds
        found: Metrics = {
            "position_rmse": math.sqrt(_integral(e**2, t) / duration) if duration else float(e[0]),
            "position_iae": _integral(e, t),
            "position_itae": _integral(t * e, t),
            "position_max": float(e.max()),
            "settling_time": _settling_time(t, e),
            "ultimate_bound": float(e[t >= t[0] + duration * 2.0 / 3.0].max()),
            **_at_samples(signals, sampled),
            "control_effort.thrust": _integral(thrust**2, t),
            "control_effort.torque": _integral(np.square(torque).sum(axis=0), t),
            "total_variation.thrust": float(np.abs(np.diff(thrust)).sum()),
            "total_variation.torque": float(np.abs(np.diff(torque)).sum()),
            "saturation_share": float(np.diff(t)[limited[:-1]].sum() / duration) if duration else 0.0,
        }
    return {name: None if isinstance(v, float) and not math.isfinite(v) else v for name, v in found.items()}


def judged(found: Metrics, *, horizon: float, divergence_time: float | None) -> Metrics:
    """`found` with the outcome by the `horizon` [s]: one that diverged at some time has no other metric.

    Settled: the position error stays below `SETTLED` in the last third; bounded: neither that nor diverged.
    A longer horizon may make another outcome of bounded, so the horizon stands beside it.
    """
    if divergence_time is not None:
        return {"outcome": "diverged", "horizon": horizon, **dict.fromkeys(found)}
    bound = found["ultimate_bound"]
    settled = isinstance(bound, float) and bound < SETTLED
    return {"outcome": "settled" if settled else "bounded", "horizon": horizon, **found}


def position_error(signals: Mapping[str, Floats], desired: Floats) -> Floats:
    """‖P - P_d‖ [m], shape (n,)."""
    actual = np.column_stack([signals[f"plant.{name}"] for name in POSITION])
    error: Floats = np.linalg.norm(actual - desired, axis=1)
    return error


def attitude_angle(scalar: Floats) -> Floats:
    """The angle [rad] of attitude errors with these scalar parts, 2 acos(min(1, |q̃_0|))."""
    angle: Floats = 2.0 * np.arccos(np.minimum(1.0, np.abs(scalar)))
    return angle


def _integral(values: Floats, t: Floats) -> float:
    return float(0.5 * ((values[1:] + values[:-1]) * np.diff(t)).sum())


def _settling_time(t: Floats, e: Floats) -> float | None:
    outside = np.flatnonzero(e > SETTLED)
    if len(outside) == 0:
        return float(t[0])
    first_inside = outside[-1] + 1
    return float(t[first_inside]) if first_inside < len(t) else None


def _at_samples(signals: Mapping[str, Floats], sampled: npt.NDArray[np.bool_]) -> Metrics:
    result: Metrics = {"attitude_error_rmse": None, "attitude_error_max": None, "energy_growth_share": None}
    scalar, energy = (signals.get(f"controller.{name}") for name in (ATTITUDE_ERROR_SCALAR, ENERGY))
    if scalar is not None and sampled.any():
        angle = attitude_angle(scalar[sampled])
        result["attitude_error_rmse"] = math.sqrt(float(np.mean(angle**2)))
        result["attitude_error_max"] = float(angle.max())
    if energy is not None and sampled.any():
        result["energy_growth_share"] = float(np.count_nonzero(np.diff(energy[sampled]) > 0.0) / sampled.sum())
    return result
