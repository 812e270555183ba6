"""The orders in which the events of a piece of a period may come, each with the draws for which they do.

Draws are divided along the lines on which two events change places that do not commute. On such a line, and where lines
meet, events of one instant may have an effect that they have on neither side: then it has an order of its own.
"""

import itertools
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction

from orchestration.foundation.basics.errors import UsageError
from orchestration.theory.certificates.certified_loop import Point
from orchestration.theory.certificates.course import PieceAt, Steps, time_at

MOST_ORDERS = 64
"""orders of one piece"""
TRIES = 5
"""points within a region that are tried for one at which no two events are at one time by chance"""

Vertex = tuple[Fraction, ...]
Region = tuple[Vertex, ...]
"""A point, the ends of a segment, or the corners of a convex polygon one after the other"""
Same = Callable[[Steps, Steps, Point], bool]
"""Whether two courses have the same effect at a point"""
Gaps = Callable[[Steps], list[Point]]
"""The times from events to later ones with which they may not change places"""


@dataclass(frozen=True, kw_only=True)
class Order:
    """The steps of a piece, and the region of draws in which they are these."""

    region: Region
    steps: Steps
    gaps: list[Point]

    def holds(self, point: Point) -> bool:
        """Whether events are in this order at a point, or at one time."""
        return all(time_at(gap, point) >= 0 for gap in self.gaps)


def orders_of(of: PieceAt, same: Same, gaps: Gaps, corners: Sequence[Point]) -> list[Order]:
    """The orders of a piece for all draws in the convex hull of `corners`, one after the other along its border.

    Raises `UsageError` where there are too many.
    """
    found, waiting = list[Order](), [_distinct([tuple(map(Fraction, corner)) for corner in corners])]
    while waiting:
        region = waiting.pop()
        steps = _steps_within(of, region)
        apart = gaps(steps)
        for gap in apart:
            beyond = _part(region, [-x for x in gap])
            if any(_value(gap, vertex) < 0 for vertex in beyond):
                waiting.append(beyond)
                region = _part(region, gap)
        found.append(Order(region=region, steps=steps, gaps=apart))
        if len(found) > MOST_ORDERS:
            raise UsageError(f"expected draws for which events come in {MOST_ORDERS} orders at most; here in more")
    for order in found:
        if not same(of(point := _inner(order.region, 1)), order.steps, point):
            raise RuntimeError(f"at {point} the steps of a period are not those of the draws about it")
    for border in (*_borders(found), *_points(found)):
        places = [_inner(border, k) for k in range(len(border) + 1)]
        if not any(all(order.holds(x) and same(of(x), order.steps, x) for x in places) for order in found):
            steps = _steps_within(of, border)
            found.append(Order(region=border, steps=steps, gaps=gaps(steps)))
    return found


def boxes_of(region: Region, width: int) -> Iterator[tuple[tuple[int, int], ...]]:
    """The ends, along each quantity, of boxes that cover a region, each at most `width` of the first where it must."""
    ends = [(min(along), max(along)) for along in zip(*region)]
    if len(region) < 3 or (len(region) == 4 and all(x in along for each in region for x, along in zip(each, ends))):
        yield tuple((int(low), int(-(-high // 1))) for low, high in ends)
        return
    low, high = ends[0]
    count = -(-(high - low) // max(width, 1))
    for i in range(int(count)):
        left, right = (low + (high - low) * k / count for k in (i, i + 1))
        part = _part(_part(region, [-left, 1, 0]), [right, -1, 0])
        seconds = [vertex[1] for vertex in part]
        yield (int(left), int(-(-right // 1))), (int(min(seconds)), int(-(-max(seconds) // 1)))


def _steps_within(of: PieceAt, region: Region) -> Steps:
    """The steps at draws of a region, their times by the values of quantities."""
    for k in range(TRIES):
        found = _about(of, _inner(region, k), _directions(region))
        if found is not None:
            return found
    raise UsageError("expected draws of which two do not change the order of events by an attosecond")


def _about(of: PieceAt, point: Point, directions: Sequence[Point | None]) -> Steps | None:
    """The steps about a point, moved by quantity in a direction, or not; None where they are others nearby."""
    here = of(point)
    moved = [here if d is None else of(tuple(x + y for x, y in zip(point, d))) for d in directions]
    found: Steps = []
    for others in moved:
        if len(others) != len(here):
            return None
    for step, *others in zip(here, *moved):
        if isinstance(step, tuple):
            added = [other[0] - step[0] for other in others if isinstance(other, tuple)]
            if len(added) < len(others):
                return None
            found.append((step[0] - sum(s * x for s, x in zip(added, point)), *added))
        else:
            if any(isinstance(other, tuple) or not step.is_same(other) for other in others):
                return None
            found.append(step)
    return found


def _directions(region: Region) -> list[Point | None]:
    """By quantity a direction within a region in which it grows by 1, None where it does not, or another one does."""
    count = len(region[0])
    if len(region) > 2:
        return [tuple(int(i == j) for j in range(count)) for i in range(count)]
    along = [b - a for a, b in zip(region[0], region[-1])]
    first = next((i for i, x in enumerate(along) if x), None)
    if first is None:
        return [None] * count
    direction = tuple(x / along[first] for x in along)
    assert all(x.denominator == 1 for x in direction)
    return [tuple(map(int, direction)) if i == first else None for i in range(count)]


def _inner(region: Region, k: int) -> Point:
    """The k-th of some points within a region."""
    weights = [1 + (7 * i + 5 * k * (i + 1)) % 11 for i in range(len(region))]
    mean = [sum(w * x for w, x in zip(weights, along)) / sum(weights) for along in zip(*region)]
    if len(region) == 2:  # on the segment, where the other quantity follows the first that varies
        first = next(i for i, (a, b) in enumerate(zip(*region)) if a != b)
        share = (round(mean[first]) - region[0][first]) / (region[1][first] - region[0][first])
        mean = [a + share * (b - a) for a, b in zip(*region)]
    return tuple(map(round, mean))


def _towards(region: Region, vertex: Vertex) -> Region:
    """A region shrunk to a tenth about a vertex."""
    return tuple(tuple(v + (x - v) / 10 for x, v in zip(other, vertex)) for other in region)


def _value(time: Sequence[int | Fraction], vertex: Vertex) -> Fraction:
    return Fraction(time[0] + sum(s * x for s, x in zip(time[1:], vertex)))


def _part(region: Region, time: Sequence[int | Fraction]) -> Region:
    """The part of a region where a time is at least 0; it may be empty."""
    found = list[Vertex]()
    for a, b in zip(region, (*region[1:], region[0])):
        at_a, at_b = _value(time, a), _value(time, b)
        if at_a >= 0:
            found.append(a)
        if at_a * at_b < 0:
            found.append(tuple(x + (y - x) * at_a / (at_a - at_b) for x, y in zip(a, b)))
    return _distinct(found)


def _distinct(vertices: Sequence[Vertex]) -> Region:
    """The corners of the convex hull, one after the other."""
    ordered = sorted(set(vertices))
    if len(ordered) < 3 or len(ordered[0]) == 1:
        return tuple(dict.fromkeys((ordered[0], ordered[-1]))) if ordered else ()
    halves = []
    for side in (ordered, ordered[::-1]):
        half = list[Vertex]()
        for c in side:
            while len(half) > 1 and _turn(half[-2], half[-1], c) <= 0:
                half.pop()
            half.append(c)
        halves.append(half[:-1])
    return tuple(itertools.chain(*halves))


def _turn(a: Vertex, b: Vertex, c: Vertex) -> Fraction:
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])


def _borders(orders: Sequence[Order]) -> list[Region]:
    """The sides of polygons, divided at the corners of others."""
    found = dict[Region, None]()
    corners = {vertex for order in orders for vertex in order.region}
    for region in (order.region for order in orders if len(order.region) > 2):
        for a, b in zip(region, (*region[1:], region[0])):
            (low, high) = sorted((a, b))
            on = sorted(c for c in corners if low <= c <= high and _turn(a, b, c) == 0)
            found |= dict.fromkeys(itertools.pairwise(on))
    return list(found)


def _points(orders: Sequence[Order]) -> list[Region]:
    return [(vertex,) for vertex in sorted({vertex for order in orders for vertex in order.region})]
