"""The expected costs of a linear loop from its initial state to a given time: moments from cut to cut of its chain."""

from collections.abc import Iterable

import numpy as np

from orchestration.foundation.basics.simulator import Floats
from orchestration.theory.exact.branch import Mode
from orchestration.theory.exact.pieces import Piece
from orchestration.theory.exact.timing_chain import TimingChain

Moments = dict[Mode, Floats]
"""Moments by mode: E[z z'] restricted to that mode; one number of z is 1: its row has the means, its square is the
probability of the mode"""


def costs_until(chain: TimingChain, start: Floats, one: int, end: int) -> Floats:
    """The expected costs, shape (costs,), from the state `start` at 0 to `end` [attoseconds].

    Number `one` of the state is the constant 1. The costs are not finite where the moments overflow.
    """
    with np.errstate(over="ignore", invalid="ignore"):
        moments, costs = _after(np.outer(start, start), chain.initial_passages(end), one)
        known: dict[tuple[int, Mode], list[tuple[Mode, float, Piece]]] = {}
        count, k = len(chain.cuts), 0
        while chain.cut_time(k) < end:
            i, turns = k % count, k // count
            is_last = chain.cut_time(k + 1) > end
            later: Moments = {}
            for mode, before in moments.items():
                if is_last:
                    known[i, mode] = list(chain.passages_from(i, mode, end - turns * chain.length))
                elif (i, mode) not in known:
                    known[i, mode] = list(chain.passages_from(i, mode))
                reached, cost = _after(before, known[i, mode], one)
                costs = costs + cost
                for then, part in reached.items():
                    later[then] = later[then] + part if then in later else part
            moments, k = later, k + 1
    return costs


def _after(before: Floats, passages: Iterable[tuple[Mode, float, Piece]], one: int) -> tuple[Moments, Floats]:
    """The moments by mode after passages from one mode, and the costs of these."""
    reached: Moments = {}
    costs: Floats = np.zeros(1)
    for mode, probability, piece in passages:
        costs = costs + probability * (np.einsum("kij,ij->k", piece.M, before) + before[one, one] * piece.c)
        part = probability * (piece.Z @ before @ piece.Z.T + before[one, one] * piece.W)
        reached[mode] = reached[mode] + part if mode in reached else part
    return reached, costs
