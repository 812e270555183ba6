"""Searches periodic sequences of letters that make a loop unstable, and so bound certificates from above."""

import functools
import itertools
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from orchestration.foundation.basics.bisection import first_failure
from orchestration.foundation.basics.simulator import Floats
from orchestration.theory.certificates.family import LoopFamily

LONGEST_SEQUENCE = 6
"""letters after which a sequence repeats"""
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
