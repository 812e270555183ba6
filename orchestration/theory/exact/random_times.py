"""Random times as values with probabilities, and the tasks and links of a loop that have them."""

import functools
import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from orchestration.foundation.basics.simulator import Floats
from orchestration.foundation.basics.times import NANOSECONDS, exact_nanoseconds

Draw = tuple[int, float]
"""A value, and its probability"""
Kinks = Callable[[int, int], Sequence[int]]
"""The times strictly between two times at which costs may have a kink over the time of an event"""


@dataclass(frozen=True)
class RandomTime:
    """A random amount of time, in whole units of the caller's choice."""

    values: tuple[int, ...] = (0,)
    """all values, or the two ends of a density"""
    probabilities: tuple[float, ...] = (1.0,)
    """Probabilities of the values; empty for a density"""
    normal: tuple[float, float] | None = None
    """mean and standard deviation of a normal density, truncated to its ends; None: uniform"""
    added: "RandomTime | None" = None
    """another, independent amount that is added"""

    @property
    def is_by_rule(self) -> bool:
        """Whether there are more values than are enumerated."""
        by_rule = not self.probabilities or len(self.values) > FEW
        return by_rule or (self.added is not None and self.added.is_by_rule)

    @property
    def lowest(self) -> int:
        """The least value."""
        return min(self.values) + (0 if self.added is None else self.added.lowest)

    @property
    def highest(self) -> int:
        """The largest one."""
        return max(self.values) + (0 if self.added is None else self.added.highest)

    @property
    def is_certain(self) -> bool:
        """Whether there is one value only."""
        return self.lowest == self.highest

    def draws(self, base: int, kinks: Kinks, order: int) -> list[Draw]:
        """The values, with probabilities.

        A density or a long table has `order` values in each part between the `kinks` of `base` plus the value: with
        these, integrals of functions that are smooth there converge faster than any power of the order.
        """
        if self.added is None:
            return self._own_draws(base, kinks, order)
        found: dict[int, float] = {}
        for value, p in self._own_draws(base, lambda low, high: (), order):
            for further, q in self.added.draws(base + value, kinks, order):
                found[value + further] = found.get(value + further, 0.0) + p * q
        return sorted(found.items())

    def _own_draws(self, base: int, kinks: Kinks, order: int) -> list[Draw]:
        low, high = min(self.values), max(self.values)
        if low == high:
            return [(low, 1.0)]
        if self.probabilities and len(self.values) <= FEW:
            return list(zip(self.values, self.probabilities))
        edges = [base + low, *kinks(base + low, base + high), base + high]
        found: list[Draw] = []
        for a, b in itertools.pairwise(edges):
            nodes, weights = self._rule(a - base, b - base, order)
            found += [(a - base + round((b - a) * node), weight) for node, weight in zip(nodes, weights)]
        total = sum(weight for _, weight in found)
        return [(value, weight / total) for value, weight in found]

    def _rule(self, a: int, b: int, order: int) -> tuple[Sequence[float], Sequence[float]]:
        """Nodes, as fractions of the part from a to b, and their weights there."""
        if self.probabilities:
            last = b == max(self.values)
            inside = [(v, p) for v, p in zip(self.values, self.probabilities) if a <= v < b or (last and v == b)]
            if not inside:
                return [], []
            shares = np.array([(v - a) / (b - a) for v, _ in inside])
            return gauss_of(shares, np.array([p for _, p in inside]), order)
        if self.normal is None:
            nodes, weights = _legendre(order)
            return nodes.tolist(), ((b - a) * weights).tolist()
        nodes, weights = _legendre(FINE)
        mean, deviation = self.normal
        normalised = (a + (b - a) * nodes - mean) / deviation
        return gauss_of(nodes, (b - a) * weights * np.exp(-0.5 * normalised**2), order)


FEW = 40
"""values of a table that are enumerated"""
FINE = 120
"""nodes that sample a density, from which those of its rule are computed"""


@functools.lru_cache(maxsize=64)
def _legendre(order: int) -> tuple[Floats, Floats]:
    """Nodes and weights over [0, 1]."""
    nodes, weights = np.polynomial.legendre.leggauss(order)
    return 0.5 * (nodes + 1.0), 0.5 * weights


def gauss_of(values: Floats, weights: Floats, order: int) -> tuple[Sequence[float], Sequence[float]]:
    """The fewest nodes, with weights, that give the same integrals of polynomials up to degree 2 order - 1.

    By Lanczos: the nodes are the eigenvalues of the multiplication by the value, restricted to the first polynomials.
    """
    total = float(weights.sum())
    root = np.sqrt(weights / total)
    basis, diagonal, beside = [root], list[float](), list[float]()
    for _ in range(order):
        raised = values * basis[-1]
        diagonal.append(float(raised @ basis[-1]))
        for each in (*basis, *basis):  # twice, against rounding
            raised = raised - (raised @ each) * each
        beside.append(float(np.linalg.norm(raised)))
        if beside[-1] < VANISHING:
            break
        basis.append(raised / beside[-1])
    count = len(diagonal)
    nodes, vectors = np.linalg.eigh(
        np.diag(diagonal) + np.diag(beside[: count - 1], 1) + np.diag(beside[: count - 1], -1)
    )
    return nodes.tolist(), (total * vectors[0] ** 2).tolist()


VANISHING = 1e-14
"""norm of a vanishing polynomial: there are no more values than nodes"""

CERTAIN = RandomTime()
"""0"""


def uniform(low: int, high: int) -> RandomTime:
    """Uniform between two values."""
    return RandomTime((low, high), ()) if high > low else RandomTime((low,))


def normal(mean: float, deviation: float, low: int, high: int) -> RandomTime:
    """Normal, truncated to a range."""
    return RandomTime((low, high), (), (mean, deviation)) if high > low else RandomTime((low,))


def table(values: Sequence[int], probabilities: Sequence[float]) -> RandomTime:
    """Listed values."""
    found: dict[int, float] = {}
    for value, p in zip(values, probabilities):
        if p > 0.0:
            found[value] = found.get(value, 0.0) + p
    listed = sorted(found)
    return RandomTime(tuple(listed), tuple(found[value] for value in listed))


ATTOSECONDS = 10**18


@dataclass(frozen=True, kw_only=True)
class SampledTask:
    """A component that samples at each offset + k period + jitter."""

    name: str
    period: Fraction
    offsets: tuple[Fraction, ...] = (Fraction(0),)
    """Offsets in ascending order"""
    numbers: tuple[int, ...] = (0,)
    """Numbers of the samples at these offsets in a period that begins at a multiple of it, up to one for all periods;
    those of the samples of a component of several rates count whose turn it is"""
    jitter: RandomTime = CERTAIN


@dataclass(frozen=True, kw_only=True)
class RandomLink:
    """The messages of one connection: one at each sample of its sender, or of its receiver."""

    name: str
    size: int
    """numbers in a message"""
    sender: int | None = None
    """index of the sending task; None: continuous time"""
    receiver: int | None = None
    """index of the receiving task, likewise"""
    step: Fraction | None = None
    """period of the messages, where no task sends or receives"""
    send_offsets: tuple[Fraction, ...] = (Fraction(0),)
    """Offsets of the messages in each step"""
    transit_times: tuple[int | None, ...] = (0,)
    """Time in transit to which the delay is added, for each offset of its sender, or of `send_offsets`; None: nothing
    is sent"""
    delay: int = 0
    delay_jitter: RandomTime = CERTAIN
    loss: float = 0.0
    burst_length: float | None = None
    jacobi: bool = False
    settles: bool = False
    """whether it goes to a component in continuous time, on which it acts after the samples of the instant"""
    first_order: bool = False
    """whether its hold is of first order"""

    @property
    def longest_delay(self) -> int:
        """The longest time from sending to arrival."""
        transit = max((each for each in self.transit_times if each is not None), default=0)
        return transit + self.delay + self.delay_jitter.highest

    @property
    def is_repeatable(self) -> bool:
        """Whether in place of a lost message the one before may arrive again: this changes nothing then.

        So whether messages were lost is in their numbers, and need not be known of each in transit.
        """
        times = {each for each in self.transit_times if each is not None}
        return self.delay_jitter.is_certain and len(times) <= 1 and not self.first_order

    @property
    def is_measured(self) -> bool:
        """Whether a task reads a signal in continuous time."""
        return self.sender is None and self.receiver is not None

    @property
    def is_read_ahead(self) -> bool:
        """Whether it is measured before the sample that uses it."""
        return self.is_measured and self.longest_delay > 0

    @property
    def has_bursts(self) -> bool:
        """Whether a loss makes the next one likelier."""
        return self.burst_length is not None and 0.0 < self.loss < 1.0


def exact_seconds(seconds: float) -> Fraction:
    """The rational number that the decimal form of `seconds` means."""
    return exact_nanoseconds(seconds) / NANOSECONDS


def attoseconds(seconds: Fraction) -> int:
    """A time in whole attoseconds."""
    return round(seconds * ATTOSECONDS)
