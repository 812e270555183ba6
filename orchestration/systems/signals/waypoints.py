"""Curves through the points of a CSV file: `time, x, y, z`, or `x, y, z` with limits that determine the times."""

from collections.abc import Mapping, Sequence
from itertools import pairwise
from pathlib import Path

import numpy as np

from orchestration.foundation.basics.errors import UsageError
from orchestration.foundation.basics.simulator import Floats
from orchestration.systems.signals.library import AXES, SignalLimits
from orchestration.systems.signals.spline import DEGREE, Spline, through
from orchestration.systems.signals.table_file import TIME, TableRows, read_rows

HOLD, SPEED = "hold", "speed"
_SAMPLES, _REFINEMENTS = 32, 3
"""Samples of a piece, and of the neighbourhood of the largest in each refinement; the number of refinements"""


def read_waypoints(path: Path, limits: Mapping[str, float]) -> Spline:
    """The curve through the points [m] of a CSV file; `limits` are fields of `Limits`, for a file without times.

    Raises `UsageError`, naming line and column, for any other file.
    """
    rows = read_rows(path, AXES)
    known = (TIME, *AXES) if TIME in rows.columns else (*AXES, HOLD, SPEED)
    for name in rows.columns:
        if name not in known:
            raise UsageError(f"{path}: column {name}: expected {', '.join(known)} only")
    points = np.column_stack([rows.columns[axis] for axis in AXES])
    if TIME in rows.columns:
        if limits:
            raise UsageError(f"parameters.{next(iter(limits))}: expected none; {path} has times")
        rows.expect_increasing_times()
        return through(rows.columns[TIME], points)
    return _timed(rows, points, SignalLimits(**limits))


def _timed(rows: TableRows, points: Floats, limits: SignalLimits) -> Spline:
    """Curves from hold to hold, each as fast as the limits allow."""
    count = len(points)
    holds = rows.columns.get(HOLD, np.zeros(count))
    speeds = rows.columns.get(SPEED, np.full(count, limits.speed))
    for row in range(count):
        if holds[row] < 0.0:
            raise rows.error(row, HOLD, "zero or a positive number of seconds")
        if speeds[row] <= 0.0 and row:
            raise rows.error(row, SPEED, "a positive number, the largest on the way to this point")
        if row and (points[row] == points[row - 1]).all():
            raise rows.error(row, "x", "another point than the one before; to stay there, give that a hold")
    stops = [0, *(i for i in range(1, count - 1) if holds[i] > 0.0), count - 1]
    now, curves = 0.0, []
    for first, last in pairwise(stops):
        if holds[first] > 0.0:
            curves.append(_at_rest(now, now + float(holds[first]), points[first]))
            now += float(holds[first])
        curve = _limited(points[first : last + 1], speeds[first + 1 : last + 1], limits.acceleration)
        curves.append(Spline(knots=now + curve.knots, coefficients=curve.coefficients))
        now = float(curves[-1].knots[-1])
    return _joined(curves)


def _limited(points: Floats, speeds: Floats, acceleration: float) -> Spline:
    """The curve from rest to rest. The time of each piece is its length by its speed, twice that for the first and the
    last, which accelerate and slow down; then all times are scaled so that speed or acceleration just reaches a limit.
    """
    spans = np.linalg.norm(np.diff(points, axis=0), axis=1) / speeds
    spans[0] += spans[0]
    spans[-1] += spans[-1] if len(spans) > 1 else 0.5 * spans[-1]
    curve = through(np.append(0.0, np.cumsum(spans)), points)
    factor = max(_peak(curve, 1, speeds), _peak(curve, 2, np.full(len(spans), acceleration)) ** 0.5)
    return Spline(knots=curve.knots * factor, coefficients=curve.coefficients)


def _peak(curve: Spline, order: int, limits: Floats) -> float:
    """The largest ratio of a derivative of the curve to the limit of its piece."""
    begins, ends = curve.knots[:-1], curve.knots[1:]
    shares = np.linspace(0.0, 1.0, _SAMPLES + 1)
    for _ in range(_REFINEMENTS):
        t = begins[:, None] + (ends - begins)[:, None] * shares
        size = np.linalg.norm(curve.at(t.ravel())[:, order], axis=1).reshape(t.shape)
        best = size.argmax(axis=1)
        pieces = np.arange(len(t))
        begins, ends = t[pieces, np.maximum(best - 1, 0)], t[pieces, np.minimum(best + 1, _SAMPLES)]
    return float((size.max(axis=1) / limits).max())


def _at_rest(begin: float, end: float, point: Floats) -> Spline:
    coefficients = np.zeros((1, DEGREE + 1, len(AXES)))
    coefficients[0, 0] = point
    return Spline(knots=np.array([begin, end]), coefficients=coefficients)


def _joined(curves: Sequence[Spline]) -> Spline:
    return Spline(
        knots=np.concatenate([curves[0].knots[:1], *(curve.knots[1:] for curve in curves)]),
        coefficients=np.concatenate([curve.coefficients for curve in curves]),
    )
