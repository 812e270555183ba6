"""The proof that every state in an ellipsoid comes to rest: V(x) = |R x|² decreases in each period everywhere in V ≤ 1.

Boxes are of y, with x = T y and T nearly the inverse of R, so that V is nearly |y|². Two things are proved:

- In the inner box, where no coordinate of y exceeds some number, the change of V is yᵀ Q y, with Q within a negative
  definite interval matrix: V decreases there by a share of itself.
- In the rest of the ellipsoid V decreases by more than `FALL`. Boxes for which this is not shown are halved.

So V tends to 0, even if the law is discontinuous. By mirror symmetry, half of the boxes suffice.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from contextlib import suppress

import numpy as np
from flint import arb, arb_mat

from docs.lateral_basin.boxes import ALL, Boxes, outside
from docs.lateral_basin.centred import Centred
from docs.lateral_basin.intervals import Intervals, OutOfReachError
from docs.lateral_basin.period import Loop
from orchestration.foundation.basics.errors import QuadcosimError
from orchestration.foundation.basics.simulator import Floats
from orchestration.theory.certificates.verify_certificate import is_positive

HALVINGS = 9
"""Halvings of the box around the ellipsoid, before the inner box is given up"""
FALL = 1e-9
"""least decrease of V in a period: more than the rounding of all constants of the equations"""
MIN_RADIUS = 1e-5
"""Least radius of a box in y: smaller boxes are not halved"""
AT_ONCE = 2048
"""boxes in one evaluation"""
SHORT = 0.1
"""relative to the distance from 0: boxes this short along y or z are not halved because of jumps of the law"""
LARGER = 2.0
"""largest factor on a proved ellipsoid that is tried"""
JUMPING = (0, 4)
"""the coordinates along which the law is discontinuous: those of y and z"""


class NotProven(QuadcosimError):
    """V does not decrease, or this is not shown."""


class Decrease:
    """The decrease of V = |R x|² in a period of a loop."""

    def __init__(self, loop: Loop, R: Floats) -> None:
        self._loop, self._R, self._T = loop, R, np.linalg.inv(R)
        if not np.abs(R @ self._T - np.eye(len(R))).max() < 1e-6:
            raise NotProven("R is not a matrix that can be inverted")
        if R[:4, 4:].any() or R[4:, :4].any():
            raise NotProven("R mixes the coordinates that a mirror turns round, the first four, with the others")
        self.edges: Floats = loop.gains.epsilon * np.diag(R)[list(JUMPING)]

    def form(self, boxes: Boxes) -> Centred:
        """V over boxes."""
        state = self._state(boxes)
        return _sum([v * v for v in (_weighted(row, state) for row in self._R)])

    def over(self, boxes: Boxes) -> Centred:
        """The change of V over boxes."""
        v, dv = self._both(boxes)
        return _sum([d * (2.0 * x + d) for x, d in zip(v, dv)])

    def matrix(self, inner: float) -> arb_mat:
        """Q such that the change of V is yᵀ Q y, where no coordinate of y exceeds `inner`."""
        around_zero = Boxes(centre=np.zeros((len(self._R), 1)), radius=np.full((len(self._R), 1), inner))
        v, dv = (arb_mat([_balls(x.slopes) for x in numbers]) for numbers in self._both(around_zero))
        return v.transpose() * dv + dv.transpose() * v + dv.transpose() * dv

    def _state(self, boxes: Boxes) -> list[Centred]:
        return [Centred.linear(row, boxes.centre, boxes.radius) for row in self._T]

    def _both(self, boxes: Boxes) -> tuple[list[Centred], list[Centred]]:
        state = self._state(boxes)
        changes = self._loop.change(state)
        return [_weighted(row, state) for row in self._R], [_weighted(row, changes) for row in self._R]


def prove(loop: Loop, R: Floats, most: int) -> int:
    """Prove the decrease; returns the number of boxes. Raises `NotProven` if V rises or `most` boxes do not suffice."""
    fall = Decrease(loop, R)
    _expect_no_rise_from_the_edge(fall, len(R))
    inner = _inner(fall)
    return prove_boxes(fall, outside(inner, len(R)), inner, most)


def prove_boxes(fall: Decrease, left: Boxes, inner: float, most: int) -> int:
    """As `prove`, for the part of these boxes in the ellipsoid and outside of the inner box."""
    count = 0
    while len(left):
        boxes, left = left[-AT_ONCE:], left[:-AT_ONCE]
        count += len(boxes)
        boxes = boxes[fall.form(boxes).anywhere.low <= 1.0]
        boxes = boxes[(np.abs(boxes.centre) + boxes.radius).max(axis=0) > inner]
        if len(boxes):
            left = left.joined_with(*_open(fall, boxes))
        if count + len(left) > most:
            raise NotProven(f"{most} boxes do not show that the form falls")
    return count


def refuted_factor(loop: Loop, R: Floats) -> float:
    """The least factor, in steps of 1/20, on the ellipsoid at which V rises at its edge; inf: none up to `LARGER`."""
    for times in np.arange(1.05, LARGER, 0.05).tolist():
        try:
            _expect_no_rise_from_the_edge(Decrease(loop, R / times), len(R))
        except NotProven:
            return float(times)
    return math.inf


def _expect_no_rise_from_the_edge(fall: Decrease, size: int) -> None:
    """Raise `NotProven` if V rises from one of some points just inside of the edge, where it rises first."""
    at = np.random.default_rng(1).standard_normal((size, AT_ONCE))
    edge = Boxes(centre=0.999 * at / np.linalg.norm(at, axis=0), radius=np.zeros_like(at))
    try:
        _expect_no_rise(fall, edge, fall.over(edge))
    except OutOfReachError as error:
        raise NotProven(f"the ellipsoid is too large: {error}") from None


def _inner(fall: Decrease) -> float:
    """The size of the inner box."""
    for inner in (ALL * 0.5**i for i in range(HALVINGS)):
        with suppress(OutOfReachError):
            Q = fall.matrix(inner)
            if is_positive(-Q - arb_mat((FALL * np.eye(Q.nrows())).tolist())):
                return inner
    raise NotProven(f"about rest, |y| ≤ {inner:.3g}, the form does not fall for all that the law may be there")


def _open(fall: Decrease, boxes: Boxes) -> Sequence[Boxes]:
    """The boxes that remain to be proved, halved."""
    try:
        change = fall.over(boxes)
    except OutOfReachError:
        return boxes.halved(np.argmax(boxes.radius, axis=0))
    _expect_no_rise(fall, boxes, change)
    wide = change.anywhere.high >= -FALL
    boxes = boxes[wide]
    if (boxes.radius.min(axis=0, initial=1.0) < MIN_RADIUS).any():
        raise NotProven(f"boxes of {MIN_RADIUS:g} do not show that the form falls")
    return boxes.halved(_longest(change.slopes[:, wide], change.values[1][wide], boxes, fall.edges))


def _expect_no_rise(fall: Decrease, boxes: Boxes, change: Centred) -> None:
    """Raise `NotProven` if V rises at the centre of a box in the ellipsoid."""
    rises = (change.values[1].low > 0.0) & (fall.form(boxes).values[1].high <= 1.0)
    if rises.any():
        raise NotProven(f"the form rises from y = {boxes.centre[:, rises][:, 0].round(3).tolist()}")


def _longest(slopes: Intervals, centre: Intervals, boxes: Boxes, edges: Floats) -> Floats:
    """The coordinate along which to halve each box: that with which the change of V varies most.

    If its uncertainty has another cause, the one along which the law jumps or bends sharply, unless the box is already
    short there.
    """
    shares = slopes.size * boxes.radius
    jumps = np.array(JUMPING)
    relative = boxes.radius[jumps] / np.maximum(np.abs(boxes.centre[jumps]), edges[:, None])
    by_jumps = (centre.high - centre.low > 2.0 * shares.sum(axis=0)) & (relative.max(axis=0) > SHORT)
    found: Floats = np.where(by_jumps, jumps[relative.argmax(axis=0)], shares.argmax(axis=0))
    return found


def _weighted(weights: Floats, numbers: Sequence[Centred]) -> Centred:
    return _sum([w * x for w, x in zip(weights.tolist(), numbers) if w])


def _sum(numbers: Sequence[Centred]) -> Centred:
    total = numbers[0]
    for number in numbers[1:]:
        total = total + number
    return total


def _balls(slopes: Intervals) -> list[arb]:
    """The slopes of the only box as balls."""
    return [arb(low).union(arb(high)) for low, high in zip(slopes.low[:, 0].tolist(), slopes.high[:, 0].tolist())]
