"""Searches periodic sequences of letters that make a loop unstable, and so bound certificates from above."""

import functools
import itertools
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from orchestration.foundation.basics.bisection import first_failure
from orchestration.foundation.basics.simulator import Floats
from orchestration.theory.certificates.family import LoopFamily

LONGEST_SEQUENCE = 6
"""letters after which a sequence repeats"""
MOST_ARRIVALS = 10
"""messages that arrive after a run of losses"""
SCAN = 24
"""values that are tried before the first unstable one is bisected"""
FINE = 1e-4
"""Tolerance of the bisection, as a share of the range"""

Draw = tuple[int, tuple[float, ...]]
"""Letter, and the values of its parameters"""


@dataclass(frozen=True, kw_only=True)
class BreakingSequence:
    """A sequence that makes a loop unstable."""

    value: float
    """the least at which one was found"""
    sequence: tuple[tuple[str, tuple[float, ...]], ...]
    """letters with their parameters, repeated"""
    radius: float
    """spectral radius of the sequence"""


def unstable_sequence(family: LoopFamily, longest: int = LONGEST_SEQUENCE) -> tuple[tuple[Draw, ...], float] | None:
    """The sequence that grows most by letter, each parameter at an end of its range; None if none is unstable."""
    draws = [(i, point) for i, x in enumerate(family.letters) for point in itertools.product(*x.ranges)]
    maps = {draw: family.at(family.letters[draw[0]], draw[1]) for draw in dict.fromkeys(draws)}
    best: tuple[float, tuple[Draw, ...]] | None = None
    for word, product in _cycles(family, maps, longest):
        radius = float(np.abs(np.linalg.eigvals(product)).max())
        if radius >= 1.0 and (best is None or radius ** (1.0 / len(word)) > best[0] * (1.0 + 1e-12)):
            best = radius ** (1.0 / len(word)), word
    return None if best is None else (best[1], best[0] ** len(best[1]))


def _cycles(family: LoopFamily, maps: dict[Draw, Floats], longest: int) -> Iterator[tuple[tuple[Draw, ...], Floats]]:
    """Words that lead from a mode back to it, one of each rotation, with their products."""
    draws = list(maps)
    seen = set[tuple[int, ...]]()

    def extended(
        start: int, mode: int, word: tuple[int, ...], product: Floats
    ) -> Iterator[tuple[tuple[Draw, ...], Floats]]:
        if word and mode == start:
            least = min(word[i:] + word[:i] for i in range(len(word)))
            if least not in seen:
                seen.add(least)
                yield tuple(draws[i] for i in word), product
        if len(word) == longest:
            return
        for i, draw in enumerate(draws):
            for begin, end in family.letters[draw[0]].moves:
                if begin == mode and end >= start:  # those through a lower mode began there
                    yield from extended(start, end, (*word, i), maps[draw] @ product)

    for start in sorted({begin for letter in family.letters for begin, _ in letter.moves}):
        size = len(family.kept)
        yield from extended(start, start, (), np.eye(size))


def least_breaking(
    family_up_to: Callable[[float], LoopFamily], limit: float, longest: int = LONGEST_SEQUENCE
) -> BreakingSequence | None:
    """The least value up to `limit` at which the scan finds an unstable sequence."""
    found = functools.cache(lambda value: unstable_sequence(family_up_to(value), longest))
    rising = [min(limit, limit * i / SCAN) for i in range(SCAN + 1)]
    bracket = first_failure(lambda value: value > 0.0 and found(value) is not None, rising, FINE * limit)
    return None if bracket is None else breaking_at(family_up_to(bracket.bad), bracket.bad, longest)


def breaking_at(family: LoopFamily, value: float, longest: int = LONGEST_SEQUENCE) -> BreakingSequence | None:
    """An unstable sequence of a family; None if none was found."""
    found = unstable_sequence(family, longest)
    if found is None:
        return None
    sequence = tuple((family.letters[i].name, point) for i, point in found[0])
    return BreakingSequence(value=value, sequence=sequence, radius=found[1])


def breaking_losses(family: LoopFamily, run: int) -> BreakingSequence | None:
    """The unstable sequence with `run` losses in a row that grows most by message; None if none was found.

    It repeats that run, alone or with another one of as many losses at most, each before up to `MOST_ARRIVALS`.
    """
    letters = [[x for x in family.letters if x.name.startswith("lost") == lost] for lost in (True, False)]
    maps, pieces = [[family.at(x) for x in each] for each in letters], len(letters[0])

    @functools.cache
    def over(piece: int, losses: int, arrivals: int) -> Floats:
        kinds = enumerate([0] * losses + [1] * arrivals, piece)
        return functools.reduce(lambda total, at: maps[at[1]][at[0] % pieces] @ total, kinds, np.eye(len(family.kept)))

    first = [(run, arrivals) for arrivals in range(1, MOST_ARRIVALS + 1)]
    then = itertools.product(range(1, run + 1), range(1, MOST_ARRIVALS + 1))
    best: tuple[float, tuple[tuple[int, int], ...], int] | None = None
    for turn in [*((x,) for x in first), *itertools.product(first, then)]:
        length = sum(map(sum, turn))
        same = math.gcd(length, pieces)  # pieces at which the turn does not begin anew before the sequence repeats
        for begin in range(same):
            at, total = begin, np.eye(len(family.kept))
            for losses, arrivals in turn * (pieces // same):
                total, at = over(at % pieces, losses, arrivals) @ total, at + losses + arrivals
            radius = float(np.abs(np.linalg.eigvals(total)).max())
            growth = radius ** (1.0 / (at - begin))
            if radius >= 1.0 and (best is None or growth > best[0] * (1.0 + 1e-12)):
                best = growth, turn * (pieces // same), begin
    if best is None:
        return None
    growth, turns, begin = best
    kinds = [kind for losses, arrivals in turns for kind in [0] * losses + [1] * arrivals]
    sequence = tuple((letters[kind][at % pieces].name, ()) for at, kind in enumerate(kinds, begin))
    return BreakingSequence(value=run, sequence=sequence, radius=growth ** len(sequence))
