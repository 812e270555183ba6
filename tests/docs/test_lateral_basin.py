"""The enclosures of a period hold what a period is; what is proved is right, and what is wrong is not proved."""

from collections.abc import Sequence

import numpy as np
import pytest
from flint import arb, ctx

from docs.lateral_basin.boxes import Boxes
from docs.lateral_basin.centred import OPS, Centred
from docs.lateral_basin.intervals import Intervals, OutOfReachError
from docs.lateral_basin.period import Loop
from fmu_kit.scalar import FLOAT
from orchestration.basics.simulator import Floats

SIZES = np.array([0.2, 0.5, 0.5, 8.0, 0.2, 0.5])[:, None]
STEP, LEAST = 1e-3, 1e-11
"""Runge-Kutta steps, which the enclosures are held against, and what they may be wrong by"""


def boxes(count: int, share: float) -> Boxes:
    """Of the state, in random places; half of them within millimetres of where the law jumps."""
    generator = np.random.default_rng(2)
    centre = generator.uniform(-1.0, 1.0, (6, count)) * SIZES
    centre[[0, 4], : count // 2] = generator.uniform(-0.003, 0.003, (2, count // 2))
    return Boxes(centre=centre, radius=share * SIZES * generator.uniform(0.1, 1.0, (6, count)))


def over(these: Boxes) -> list[Centred]:
    return [Centred.linear(row, these.centre, these.radius) for row in np.eye(6)]


def points(these: Boxes, count: int) -> list[Floats]:
    """In each box: corners, and elsewhere."""
    generator = np.random.default_rng(3)
    inside = [generator.uniform(-1.0, 1.0, these.centre.shape) for _ in range(count)]
    return [these.centre + these.radius * x for x in (*inside, *map(np.sign, inside), np.zeros_like(inside[0]))]


def expect_held(numbers: Sequence[Centred], these: Boxes, at: Floats, values: Floats, slack: float) -> None:
    """Both what a number is anywhere in a box, and what it is at a point by the slopes."""
    for number, value in zip(numbers, values, strict=True):
        by_slopes = number.values[1] + (number.slopes * Intervals.of(at - these.centre)).sum()
        for held in (number.anywhere, by_slopes):
            assert (np.maximum(held.low - value, value - held.high) <= slack).all()


@pytest.mark.parametrize("period", [0.01, 0.04])
@pytest.mark.parametrize("share", [0.1, 0.003])
def test_what_a_period_does_is_within_its_enclosure(period: float, share: float) -> None:
    loop, these = Loop(period=period), boxes(300, share)
    changes = loop.change(over(these))
    for at in points(these, 5):
        expect_held(changes, these, at, loop.after(at, STEP) - at, LEAST)


def test_small_boxes_have_narrow_enclosures() -> None:
    """Where the law does not jump, halving a box leaves a quarter of what slopes are unsure of."""
    loop, these = Loop(period=0.01), boxes(400, 0.01)[200:]

    def unsure(radius: Floats) -> Floats:
        changes = loop.change(over(Boxes(centre=these.centre, radius=radius)))
        slopes = [(x.slopes.high - x.slopes.low) * radius for x in changes]
        found: Floats = np.median(np.sum(slopes, axis=1), axis=1)
        return found

    assert (unsure(these.radius / 2) < 0.3 * unsure(these.radius)).all()


def test_a_point_has_the_command_that_floats_have() -> None:
    loop, these = Loop(period=0.01), boxes(20, 0.0)
    found = loop.command(tuple(over(these)), OPS)
    for i, state in enumerate(these.centre.T.tolist()):
        for number, value in zip(found, loop.command(tuple(state), FLOAT), strict=True):
            assert number.anywhere.low[i] <= value <= number.anywhere.high[i]
            assert number.anywhere.high[i] - number.anywhere.low[i] < 1e-9 * max(1.0, abs(value))


def test_elementary_functions_are_as_right_as_they_are_taken_to_be() -> None:
    """Against ball arithmetic."""
    numbers = np.concatenate([np.random.default_rng(4).uniform(1e-3, 1.5, 500), np.geomspace(1e-12, 1.0, 100)])
    at = Intervals.of(numbers)
    cases = [
        (at.tanh(), arb.tanh), (at.sin(), arb.sin), (at.cos(), arb.cos), (at.sqrt(), arb.sqrt),
        (at.power(-0.01), lambda x: x ** arb(-0.01)), (at.reciprocal(), lambda x: 1 / x),
    ]  # fmt: skip
    with ctx.workprec(106):
        for found, exact in cases:
            for low, x, high in zip(found.low.tolist(), numbers.tolist(), found.high.tolist(), strict=True):
                assert low < exact(arb(x)) < high


def test_what_intervals_do_not_allow_is_refused() -> None:
    wide = Intervals(np.array([-1.0]), np.array([2.0]))
    for refused in (wide.reciprocal, wide.sqrt, wide.sin, wide.cos, lambda: wide.power(0.5)):
        with pytest.raises(OutOfReachError, match="-1 to 2: expected"):
            refused()


def test_a_mirrored_motion_is_the_mirror_of_the_motion() -> None:
    """For which half of the boxes is enough."""
    loop, mirror = Loop(period=0.01), np.array([-1.0, -1.0, -1.0, -1.0, 1.0, 1.0])[:, None]
    at = boxes(200, 0.0).centre
    assert loop.after(mirror * at) == pytest.approx(mirror * loop.after(at), rel=0.0, abs=1e-15)
