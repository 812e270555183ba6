"""Radii of moments of a loop whose states differ in size: those of the same loop in other units."""

import numpy as np
import pytest

from orchestration.theory.exact import moments
from orchestration.theory.exact.branch import Piece
from orchestration.theory.exact.moments import JumpLinear, Passage


def loop_of(size: int, units: float, modes: int = 1) -> JumpLinear:
    """A loop of two equally probable maps, of which each state is that of a chain in a unit of its own.

    Of several modes each leads to all.
    """
    random, scales = np.random.default_rng(4), np.geomspace(1.0, units, size)
    stage = []
    for _ in range(2):
        Z = np.triu(random.normal(size=(size, size)), 1) + np.diag(np.linspace(0.5, 0.9, size))
        Z = Z * (scales[:, None] / scales)
        piece = Piece(Z, np.eye(size), np.eye(size)[None], np.zeros(1))
        stage += [Passage(i, k, 0.5 / modes, piece) for i in range(modes) for k in range(modes)]
    return JumpLinear([stage], [[size] * modes])


def test_stationary_moments_that_are_too_many_for_a_matrix_are_those_of_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """By a sum over periods, as they need not converge in a Krylov basis where states differ in size."""
    known = [loop_of(15, 1e-6, modes).costs() for modes in (1, 2)]
    monkeypatch.setattr(moments, "DENSE", 0)
    assert loop_of(15, 1e-6, 2).costs() == pytest.approx(known[1], rel=1e-6)
    assert known[1] == pytest.approx(known[0], rel=1e-6)  # modes that are alike change nothing


def test_the_growth_of_moments_does_not_depend_on_units() -> None:
    """Maps of upper triangles: their moments grow as those of their diagonals, however large the rest."""
    for units in (1.0, 1e6):
        assert loop_of(15, units).radius == pytest.approx(0.81, rel=1e-4)
        assert loop_of(8, units).fourth_moment_radius == pytest.approx(0.9**4, rel=1e-3)
