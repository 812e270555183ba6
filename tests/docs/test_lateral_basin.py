"""The enclosures of a period hold what a period is; what is proved is right, and what is wrong is not proved."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from flint import arb, ctx

from controller_fmu.sliding_mode.law import Gains
from docs.lateral_basin.__main__ import extents, first_losses, main
from docs.lateral_basin.boxes import ALL, Boxes, outside
from docs.lateral_basin.centred import OPS, Centred
from docs.lateral_basin.ellipsoids import read_ellipsoid, write_ellipsoid
from docs.lateral_basin.intervals import Intervals, OutOfReachError
from docs.lateral_basin.period import STATES, Loop
from docs.lateral_basin.proof import Decrease, NotProven, prove, prove_boxes, refuted_factor
from docs.lateral_basin.search import largest_ellipsoid
from fmu_kit.scalar import FLOAT
from orchestration.foundation.basics.errors import UsageError
from orchestration.foundation.basics.simulator import Floats
from orchestration.theory.certificates.verify_certificate import is_positive
from tests.places import ROOT

PERIODS = (0.01, 0.04)
"""[s], of which the page has a proof"""
SIZES = np.array([0.2, 0.5, 0.5, 8.0, 0.2, 0.5])[:, None]
STEP, MIN_MARGIN = 1e-3, 1e-11
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
        expect_held(changes, these, at, loop.after(at, STEP) - at, MIN_MARGIN)


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


@pytest.mark.parametrize("period", PERIODS)
def test_the_form_that_is_kept_falls_over_boxes_here_and_there(period: float) -> None:
    """Some of those of which the proof is made; about rest, for all that the law may be there."""
    fall, generator = Decrease(Loop(period=period), read_ellipsoid(period)), np.random.default_rng(5)
    direction = generator.standard_normal((6, 500))
    size = generator.uniform(0.02, 0.97, 500)
    centre = size * direction / np.linalg.norm(direction, axis=0)
    assert (fall.over(Boxes(centre=centre, radius=np.full((6, 1), 0.005) * size)).anywhere.high < 0.0).all()
    assert is_positive(-fall.matrix(0.004))


@pytest.mark.parametrize("period", PERIODS)
def test_flights_from_its_edge_come_to_rest_and_stay_in_it(period: float) -> None:
    loop, R, direction = Loop(period=period), read_ellipsoid(period), np.random.default_rng(6).standard_normal((6, 100))
    state = np.linalg.solve(R, direction / np.linalg.norm(direction, axis=0))
    before = np.ones(100)
    for _ in range(round(6.0 / period)):
        state = loop.after(state)
        after = ((R @ state) ** 2).sum(axis=0)
        assert (after < before).all()
        before = after
    assert before.max() < 1e-4


def test_a_small_ellipsoid_is_proved_at_once() -> None:
    """There the law is nearly linear."""
    assert prove(Loop(period=0.01), read_ellipsoid(0.01) / 0.003, 1) == 0


@pytest.mark.parametrize("size", [0.3, 0.9])
def test_boxes_are_halved_until_the_form_is_seen_to_fall(size: float) -> None:
    """The law jumps in both of them."""
    fall = Decrease(Loop(period=0.01), read_ellipsoid(0.01))
    box = Boxes(centre=size * np.array([[0.05, 0.4, 0.4, 0.4, 0.05, 0.4]]).T, radius=np.full((6, 1), 0.05 * size))
    assert fall.over(box).anywhere.high > 0.0
    assert 1 < prove_boxes(fall, box, 0.0, 20_000) < 20_000


def test_what_is_not_so_is_not_proved() -> None:
    loop, R = Loop(period=0.01), read_ellipsoid(0.01)
    with pytest.raises(NotProven, match="the form rises from y = "):
        prove(loop, R / 1.5, 100_000)
    assert 1.0 < refuted_factor(loop, R) < 1.5
    with pytest.raises(NotProven, match="the ellipsoid is too large: "):
        prove(loop, R / 4.0, 100_000)
    with pytest.raises(NotProven, match="1000 boxes do not show"):
        prove(loop, R, 1000)
    with pytest.raises(NotProven, match="the form rises from y = "):
        prove(Loop(period=0.09), R / 0.01, 100_000)
    with pytest.raises(NotProven, match="the form rises from y = "):
        prove(replace(loop, gains=Gains(k_eta=-15.0)), R, 100_000)
    with pytest.raises(NotProven, match="inverted"):
        prove(loop, 1.0 + 1e-13 * R, 1)
    with pytest.raises(NotProven, match="R mixes the coordinates"):
        prove(loop, R + 0.01 * np.eye(6, k=-1), 100_000)


def test_boxes_cover_the_half_of_the_ellipsoid_but_for_the_inner_box() -> None:
    covering, generator = outside(ALL / 8, 3), np.random.default_rng(7)
    at = generator.uniform(-1.0, 1.0, (3, 2000))
    at = at[:, (at[0] > 0.0) & (np.linalg.norm(at, axis=0) <= 1.0) & (np.abs(at).max(axis=0) > ALL / 8)]
    away = np.abs(at[:, :, None] - covering.centre[:, None]) - covering.radius[:, None]
    assert away.max(axis=0).min(axis=1).max() <= 0.0


def test_halves_are_the_whole() -> None:
    whole = Boxes(centre=np.array([[1.0], [2.0]]), radius=np.array([[0.5], [1.0]]))
    below, above = whole.halved(np.array([1]))
    assert (below.centre.ravel().tolist(), above.centre.ravel().tolist()) == ([1.0, 1.5], [1.0, 2.5])
    assert below.radius.ravel().tolist() == above.radius.ravel().tolist() == [0.5, 0.5]


def test_the_page_says_how_far_what_is_kept_goes() -> None:
    page = (ROOT / "docs" / "how_far.md").read_text(encoding="utf-8")
    for period in PERIODS:
        y, vy, phi, p, z, vz = extents(read_ellipsoid(period))
        row = f"| {1e3 * period:g} ms | {1e2 * y:.1f} cm | {vy:.2f} m/s | {np.degrees(phi):.1f}° | {p:.1f} rad/s | "
        assert f"{row}{1e2 * z:.1f} cm | {vz:.2f} m/s |" in page


def test_the_command_proves_what_was_kept(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    small = read_ellipsoid(0.01) / 0.001
    monkeypatch.setattr("docs.lateral_basin.proof.LARGER", 1.1)
    monkeypatch.setattr("docs.lateral_basin.ellipsoids.FILE", tmp_path / "ellipsoids.json")
    write_ellipsoid(0.01, small)
    assert (read_ellipsoid(0.01) == small).all()
    main(["0.01"])
    assert capsys.readouterr().out.startswith("0.01 s: y ")
    with pytest.raises(UsageError, match="others are searched"):
        main(["0.5"])


def test_flights_show_where_the_basin_ends_if_they_find_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("docs.lateral_basin.__main__.STARTS", 2)
    monkeypatch.setattr("docs.lateral_basin.__main__.FLIGHT", 10.0)
    assert np.isnan(first_losses(Loop(period=0.04))[STATES.index("φ")])
    assert not np.isnan(first_losses(Loop(period=0.1))).any()


def test_the_search_finds_an_ellipsoid_in_which_points_fall(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("docs.lateral_basin.search.POINTS", 200)
    loop = Loop(period=0.01)
    R = largest_ellipsoid(loop, 2)
    at: Floats = np.linalg.inv(R) @ np.random.default_rng(8).standard_normal((6, 100)) / 6.0
    assert (np.linalg.norm(R @ loop.after(at), axis=0) < np.linalg.norm(R @ at, axis=0)).all()
