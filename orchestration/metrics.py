"""What a run comes to, as numbers."""

import math
from collections.abc import Mapping
from typing import Literal, get_args

import numpy as np
import numpy.typing as npt

from orchestration.simulator import Floats
from orchestration.timing import Hold
from orchestration.wiring import ATTITUDE_ERROR_SCALAR, COMMAND, ENERGY, POSITION

SETTLED = 0.05
"""[m] of position error"""
ENERGY_FLOOR = 1e-3
"""of the largest energy of a run: growth to less than that is not counted"""

Marks = npt.NDArray[np.bool_]
"""Of rows, shape (n,)"""
Metrics = dict[str, float | int | bool | str | None]

Outcome = Literal["settled", "bounded", "diverged"]
"""What became of a flight by its horizon: settled is what counts as flying"""
OUTCOMES: tuple[Outcome, ...] = get_args(Outcome)


def compute(
    signals: Mapping[str, Floats],
    desired: Floats,
    *,
    measured: Marks,
    arrived: Marks,
    hold: Hold,
    thrust_max: float,
    torque_max: float,
) -> Metrics:
    """The metrics of `signals` (arrays of shape (n,) by column) against the `desired` positions (n, 3) [m].

    `measured` marks the rows at which the controller got a measurement, `arrived` those at which a command
    arrived; limits are the plant's, in N and N·m. Commands are as applied to the plant, before its limits,
    and between the rows what their `hold` makes of them; their integrals are exact. Those of the position
    error are by the trapezoid rule over the rows. What is taken at samples is None without any; so is what
    no float holds.
    """
    t = signals["time"]
    e = position_error(signals, desired)
    thrust, *torque = (signals[f"plant.{name}"] for name in COMMAND)
    held = [(u, _before_next_row(t, u, arrived, hold)) for u in (thrust, *torque)]
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
            **_at_samples(signals, measured),
            "control_effort.thrust": _effort(t, *held[0]),
            "control_effort.torque": sum(_effort(t, *axis) for axis in held[1:]),
            "total_variation.thrust": _variation(*held[0]),
            "total_variation.torque": sum(_variation(*axis) for axis in held[1:]),
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


def _before_next_row(t: Floats, command: Floats, arrived: Marks, hold: Hold) -> Floats:
    """What `command` (n,), given at the rows, has become just before the row after each, shape (n - 1,).

    With first-order hold that is on the line through the last two commands that were applied. (The plant gets
    the line's value at the start of each of its steps; the line itself does not depend on their length.)
    """
    if hold == "zero":
        return command[:-1]
    marks = arrived.copy()
    marks[0] = True  # the command of the initialisation
    rows = np.flatnonzero(marks)
    slopes = np.concatenate([[0.0], np.diff(command[rows]) / np.diff(t[rows])])
    latest = np.searchsorted(rows, np.arange(len(t) - 1), side="right") - 1
    line: Floats = command[:-1] + slopes[latest] * np.diff(t)
    return line


def _effort(t: Floats, starts: Floats, ends: Floats) -> float:
    """∫u²dt of what goes from `starts` at each row along a line to `ends` before the next."""
    first = starts[:-1]
    return float((np.diff(t) * (first * first + first * ends + ends * ends)).sum() / 3.0)


def _variation(starts: Floats, ends: Floats) -> float:
    """How far a command moves in all: along its lines, and where it jumps."""
    return float(np.abs(ends - starts[:-1]).sum() + np.abs(starts[1:] - ends).sum())


def _settling_time(t: Floats, e: Floats) -> float | None:
    outside = np.flatnonzero(e > SETTLED)
    if len(outside) == 0:
        return float(t[0])
    first_inside = outside[-1] + 1
    return float(t[first_inside]) if first_inside < len(t) else None


def _at_samples(signals: Mapping[str, Floats], measured: Marks) -> Metrics:
    result: Metrics = {"attitude_error_rmse": None, "attitude_error_max": None, "energy_growth_share": None}
    scalar, energy = (signals.get(f"controller.{name}") for name in (ATTITUDE_ERROR_SCALAR, ENERGY))
    if scalar is not None and measured.any():
        angle = attitude_angle(scalar[measured])
        result["attitude_error_rmse"] = math.sqrt(float(np.mean(angle**2)))
        result["attitude_error_max"] = float(angle.max())
    if energy is not None and measured.sum() > 1:
        result["energy_growth_share"] = _growth_share(energy[measured])
    return result


def _growth_share(energy: Floats) -> float:
    """Of the steps from one value to the next, the share of those that grow and end above the floor.

    The floor keeps out what goes up and down about the end of a settled flight, at any sampling period.
    """
    floor = ENERGY_FLOOR * float(energy.max())
    return float(np.mean((np.diff(energy) > 0.0) & (energy[1:] > floor)))
