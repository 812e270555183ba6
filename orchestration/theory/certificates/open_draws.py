"""Draws of several components in a period, divided into pieces at instants at which none is open.

Of a message between sampled components it only matters what the receiver's samples read: there are choices, no draw.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from orchestration.foundation.basics.errors import UsageError
from orchestration.theory.certificates.certified_loop import Draws, Point

MOST_AT_ONCE = 2
"""quantities of several components that vary at once"""


@dataclass(frozen=True, kw_only=True)
class OpenDraws:
    """The draws that are open from a time on, and for how long [attoseconds]."""

    begin: int
    lasts: int
    quantities: tuple[int, ...]
    """Indices of these quantities, of all that vary"""
    draws: Draws

    def spread(self, count: int) -> Callable[[Point], Point]:
        """Values of all quantities, by those of these: the others are 0."""

        def values(of: Point) -> Point:
            found = dict(zip(self.quantities, of, strict=True))
            return tuple(found.get(i, 0) for i in range(count))

        return values


@dataclass(frozen=True, kw_only=True)
class Unsure:
    """A connection between sampled components, each of whose messages arrives at any time in a range [attoseconds].

    It is the last one that arrives before the next sample of the sender.
    """

    name: str
    receiver: str
    samples: Sequence[int]
    """The earliest samples of the sender in a period"""
    late: int
    """The largest lateness of each"""
    earliest: int
    """The earliest arrival after an earliest sample"""
    latest: int
    length: int
    """The period"""

    def reads(self, begin: int, end: int) -> bool | None:
        """Whether a sample of the receiver between two times reads the last message before it; None: perhaps."""
        for sample in self.samples:
            since, until = (begin - sample) % self.length, (sample - begin) % self.length
            if since <= self.latest or until <= end - begin:
                is_on_its_way = since > self.late and since + end - begin < self.earliest
                return False if is_on_its_way else None
        return True


def in_turn(spans: Sequence[OpenDraws], length: int) -> list[OpenDraws]:
    """Spans of a period of a `length`; those that are open at once are one, in which each has any of its values.

    Raises `UsageError` where one is open at every instant.
    """
    ordered = sorted(spans, key=lambda span: span.begin)
    first = next((span for span in ordered if not _is_within_others(span, ordered, length)), None)
    if first is None:
        raise UsageError("expected an instant at which no sample and no message of several components may be late")
    begin, found = first.begin, list[OpenDraws]()
    for span in sorted(ordered, key=lambda span: (span.begin - begin) % length):
        at = (span.begin - begin) % length
        if found and at < found[-1].begin - begin + found[-1].lasts:
            found[-1] = _joined(found[-1], span, begin + at)
        else:
            found.append(replace(span, begin=begin + at))
    return found


def _is_within_others(span: OpenDraws, others: Sequence[OpenDraws], length: int) -> bool:
    """Whether another one is open where a span begins, and before."""
    return any(0 < (span.begin - other.begin) % length < other.lasts for other in others)


def _joined(one: OpenDraws, other: OpenDraws, begin: int) -> OpenDraws:
    """Draws with others that begin at a time after theirs."""
    largest = [*one.draws.largest, *other.draws.largest]
    return OpenDraws(
        begin=one.begin, lasts=max(one.lasts, begin - one.begin + other.lasts),
        quantities=(*one.quantities, *other.quantities), draws=Draws(largest, sum(largest)),
    )  # fmt: skip
