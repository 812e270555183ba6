"""What a linear loop costs from where it begins to a given time: its moments go from cut to cut of its clock."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from orchestration.basics.simulator import Floats
from orchestration.exact.clockwork import Clockwork, Mode
from orchestration.exact.pieces import Piece

Moments = dict[Mode, Floats]
"""E[z z'] where a mode is, 0 elsewhere, by mode; one number of z is 1: in its row are means, its square is how likely
the mode is"""


def costs_until(clock: Clockwork, start: Floats, one: int, end: int) -> Floats:
    """The expected costs, shape (costs,), from the state `start` at 0 to `end` [attoseconds].

    Of the state, number `one` is 1. They are not finite where the moments have grown beyond all numbers.
    """
    with np.errstate(over="ignore", invalid="ignore"):
        moments, costs = _after(np.outer(start, start), clock.begun(end), one)
        known: dict[tuple[int, Mode], list[tuple[Mode, float, Piece]]] = {}
        count, k = len(clock.cuts), 0
        while clock.cut(k) < end:
            i, turns = k % count, k // count
            is_last = clock.cut(k + 1) > end
            later: Moments = {}
            for mode, before in moments.items():
                if is_last:
                    known[i, mode] = list(clock.onward(i, mode, end - turns * clock.whole))
                elif (i, mode) not in known:
                    known[i, mode] = list(clock.onward(i, mode))
                reached, cost = _after(before, known[i, mode], one)
                costs = costs + cost
                for then, part in reached.items():
                    later[then] = later[then] + part if then in later else part
            moments, k = later, k + 1
    return costs


def _after(before: Floats, ways: Iterable[tuple[Mode, float, Piece]], one: int) -> tuple[Moments, Floats]:
    """The moments by mode to which a mode may lead, and the costs on the way."""
    reached: Moments = {}
    costs: Floats = np.zeros(1)
    for mode, probability, piece in ways:
        costs = costs + probability * (np.einsum("kij,ij->k", piece.M, before) + before[one, one] * piece.c)
        part = probability * (piece.Z @ before @ piece.Z.T + before[one, one] * piece.W)
        reached[mode] = reached[mode] + part if mode in reached else part
    return reached, costs
