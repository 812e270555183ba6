"""What a run comes to, as numbers."""

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
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


COLUMNS = (
    "time",
    *(f"plant.{name}" for name in (*POSITION, *COMMAND)),
    *(f"controller.{name}" for name in (ATTITUDE_ERROR_SCALAR, ENERGY)),
)
"""What the metrics are computed from; the controller's may be absent."""


@dataclass(frozen=True, kw_only=True)
class Span:
    """Rows that follow each other."""

    signals: Mapping[str, Floats]
    """arrays of shape (n,) by column"""
    desired: Floats
    """positions [m], shape (n, 3)"""
    measured: Marks
    """the rows at which the controller got a measurement"""
    arrived: Marks
    """those at which a command arrived"""


def compute(spans: Callable[[], Iterable[Span]], *, hold: Hold, thrust_max: float, torque_max: float) -> Metrics:
    """The metrics of a flight that is given in spans, one after the other, twice.

    Limits are the plant's, in N and N·m. Commands are as applied to the plant, before its limits, and between
    the rows what their `hold` makes of them; their integrals are exact. Those of the position error are by the
    trapezoid rule over the rows. What is taken at samples is None without any; so is what no float holds.
    """
    sums = _Sums(_extent(spans()), hold=hold, thrust_max=thrust_max, torque_max=torque_max)
    with np.errstate(over="ignore"):  # a diverging run may end in squares that no float holds
        for span in spans():
            sums.add(span)
        found = sums.metrics()
    return {name: None if isinstance(v, float) and not math.isfinite(v) else v for name, v in found.items()}


@dataclass(frozen=True, kw_only=True)
class _Extent:
    """What is to be known of a whole flight before its metrics can be added up."""

    start: float
    end: float
    peak: float
    """of the energy at measured rows; minus infinity without any"""


def _extent(spans: Iterable[Span]) -> _Extent:
    times: list[float] = []
    peak = -math.inf
    for span in spans:
        times += span.signals["time"][[0, -1]].tolist() if len(span.desired) else []
        energy = span.signals.get(f"controller.{ENERGY}")
        if energy is not None and span.measured.any():
            peak = max(peak, float(energy[span.measured].max()))
    return _Extent(start=times[0], end=times[-1], peak=peak)


class _Sums:
    """Metrics as far as the spans have come; the last row of each is taken up again before the next."""

    def __init__(self, extent: _Extent, *, hold: Hold, thrust_max: float, torque_max: float) -> None:
        self._extent, self._hold = extent, hold
        self._thrust_max, self._torque_max = thrust_max, torque_max
        self._before: Span | None = None
        self._sums: dict[str, float] = dict.fromkeys(("e²", "e", "te", "limited", *_COMMAND_METRICS), 0.0)
        self._largest = self._bound = 0.0
        self._settled_at: float | None = extent.start
        self._lines: list[_Line] = []
        self._angles, self._squares, self._widest = 0, 0.0, 0.0
        self._energy: float | None = None
        self._steps, self._growths = 0, 0

    def add(self, span: Span) -> None:
        span, self._before = _joined(self._before, span), span if len(span.desired) else self._before
        t = span.signals["time"]
        self._add_position(t, position_error(span.signals, span.desired))
        self._add_commands(t, span)
        self._add_attitude(span)
        self._add_energy(span)

    def _add_position(self, t: Floats, e: Floats) -> None:
        self._sums["e²"] += _integral(e**2, t)
        self._sums["e"] += _integral(e, t)
        self._sums["te"] += _integral(t * e, t)
        self._largest = max(self._largest, float(e.max()))
        start, end = self._extent.start, self._extent.end
        self._bound = max(self._bound, float(e[t >= start + (end - start) * 2.0 / 3.0].max(initial=0.0)))
        outside = np.flatnonzero(e > SETTLED)
        if len(outside):
            inside = outside[-1] + 1
            self._settled_at = float(t[inside]) if inside < len(t) else None

    def _add_commands(self, t: Floats, span: Span) -> None:
        commands = [span.signals[f"plant.{name}"] for name in COMMAND]
        self._lines = self._lines or [_Line(time=float(t[0]), value=float(u[0]), slope=0.0) for u in commands]
        for i, u in enumerate(commands):
            ends = u[:-1]
            if self._hold == "first":
                ends, self._lines[i] = _before_next_row(t, u, span.arrived, self._lines[i])
            part = "thrust" if i == 0 else "torque"
            self._sums[f"control_effort.{part}"] += _effort(t, u, ends)
            self._sums[f"total_variation.{part}"] += _variation(u, ends)
        thrust, *torque = commands
        limited = (thrust < 0.0) | (thrust > self._thrust_max) | (np.abs(torque) > self._torque_max).any(axis=0)
        self._sums["limited"] += float(np.diff(t)[limited[:-1]].sum())

    def _add_attitude(self, span: Span) -> None:
        scalar = span.signals.get(f"controller.{ATTITUDE_ERROR_SCALAR}")
        if scalar is not None and span.measured.any():
            angle = attitude_angle(scalar[span.measured])
            self._angles += len(angle)
            self._squares += float((angle**2).sum())
            self._widest = max(self._widest, float(angle.max()))

    def _add_energy(self, span: Span) -> None:
        """Of the steps from one value to the next, those that grow and end above the floor.

        The floor keeps out what goes up and down about the end of a settled flight, at any sampling period.
        """
        energy = span.signals.get(f"controller.{ENERGY}")
        if energy is None or not span.measured.any():
            return
        fresh = energy[span.measured]
        steps = np.diff(fresh, prepend=[] if self._energy is None else [self._energy])
        floor = ENERGY_FLOOR * self._extent.peak
        self._steps += len(steps)
        self._growths += int(np.count_nonzero((steps > 0.0) & (fresh[len(fresh) - len(steps) :] > floor)))
        self._energy = float(fresh[-1])

    def metrics(self) -> Metrics:
        sums, duration = self._sums, self._extent.end - self._extent.start
        return {
            "position_rmse": math.sqrt(sums["e²"] / duration) if duration else self._largest,
            "position_iae": sums["e"],
            "position_itae": sums["te"],
            "position_max": self._largest,
            "settling_time": self._settled_at,
            "ultimate_bound": self._bound,
            "attitude_error_rmse": math.sqrt(self._squares / self._angles) if self._angles else None,
            "attitude_error_max": self._widest if self._angles else None,
            "energy_growth_share": self._growths / self._steps if self._steps else None,
            **{name: sums[name] for name in _COMMAND_METRICS},
            "saturation_share": sums["limited"] / duration if duration else 0.0,
        }


_COMMAND_METRICS = tuple(
    f"{name}.{part}" for name in ("control_effort", "total_variation") for part in ("thrust", "torque")
)


def _joined(before: Span | None, span: Span) -> Span:
    """`span` after the last row of the one `before`, at which nothing happens again, nor at the first of all."""
    if before is None:
        return replace(span, arrived=span.arrived & (np.arange(len(span.arrived)) > 0))
    none = np.zeros(1, dtype=bool)
    return Span(
        signals={name: np.append(before.signals[name][-1], values) for name, values in span.signals.items()},
        desired=np.vstack([before.desired[-1:], span.desired]),
        measured=np.append(none, span.measured),
        arrived=np.append(none, span.arrived),
    )


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


@dataclass(frozen=True, kw_only=True)
class _Line:
    """Where the last command was applied, and which way first-order hold goes on from there."""

    time: float
    value: float
    slope: float


def _before_next_row(t: Floats, command: Floats, arrived: Marks, line: _Line) -> tuple[Floats, _Line]:
    """What `command` (n,), given at the rows, has become just before the row after each, shape (n - 1,).

    With first-order hold that is on the line through the last two commands that were applied. (The plant gets
    the line's value at the start of each of its steps; the line itself does not depend on their length.)
    `line` is that at the first row, at which none arrives; beside the values that at the last row.
    """
    rows = np.flatnonzero(arrived)
    times, values = np.append(line.time, t[rows]), np.append(line.value, command[rows])
    slopes = np.append(line.slope, np.diff(values) / np.diff(times))
    latest = np.searchsorted(rows, np.arange(len(t) - 1), side="right")
    ends: Floats = command[:-1] + slopes[latest] * np.diff(t)
    return ends, _Line(time=float(times[-1]), value=float(values[-1]), slope=float(slopes[-1]))


def _effort(t: Floats, starts: Floats, ends: Floats) -> float:
    """∫u²dt of what goes from `starts` at each row along a line to `ends` before the next."""
    first = starts[:-1]
    return float((np.diff(t) * (first * first + first * ends + ends * ends)).sum() / 3.0)


def _variation(starts: Floats, ends: Floats) -> float:
    """How far a command moves in all: along its lines, and where it jumps."""
    return float(np.abs(ends - starts[:-1]).sum() + np.abs(starts[1:] - ends).sum())
