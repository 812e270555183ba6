"""A system at its operating point, without randomness, quantisation and floats of C, and whether it rests there."""

import math
from collections.abc import Callable, Collection, Sequence
from dataclasses import replace
from fractions import Fraction

import numpy as np

from orchestration.foundation.basics.errors import UsageError
from orchestration.foundation.basics.simulator import Floats
from orchestration.foundation.basics.terminal import inform
from orchestration.foundation.basics.times import NANOSECONDS, exact_nanoseconds
from orchestration.foundation.basics.unit_algebra import quantity, some
from orchestration.systems.system.component import Component
from orchestration.systems.system.distribution import is_random, lowest
from orchestration.systems.system.model import AFTER, Criterion, System
from orchestration.systems.system.paths import at_operating_point
from orchestration.systems.system.placement import punctual
from orchestration.theory.stability.in_double import in_double

AT_REST = 1e-6
"""change allowed in the first periods of the unperturbed run"""
LONGEST_HYPERPERIOD = 20
"""Longest hyperperiod of sampled components, in longest periods"""


class NotAnEquilibriumError(UsageError):
    """The operating point is no equilibrium, whatever the method."""


def deterministic(system: System) -> System:
    """`system` at its operating point, without jitter, loss, noise, quantisation and objectives.

    Float code in C is in double precision. Raises `UsageError` as `in_double`.
    """
    chosen = in_double(at_operating_point(system))
    return replace(
        chosen,
        components={name: _punctual(component) for name, component in chosen.components.items()},
        connections=tuple(
            replace(x.with_delay(lowest(x.delay)), noise={}, quantisation={}) for x in chosen.connections
        ),
        sources={
            name: replace(source, noise=0.0)
            if source.noise is not None
            else replace(source, scale=0.0)
            if source.is_random
            else source
            for name, source in chosen.sources.items()
        },
        **punctual(chosen),
        objectives={},
        criterion=Criterion(diverged=chosen.criterion.diverged),
    )


def _punctual(component: Component) -> Component:
    if component.sampling is None:
        return replace(component, record=())
    return replace(component, record=(), sampling=replace(component.sampling, jitter=0.0))


def inform_of_chance(
    system: System,
    *,
    but: Collection[str] = (),
    includes: str = "expect includes them in mean square, margin in any sequence",
) -> None:
    """Say what chance is left out of the times of a system, `but` these paths, and what `includes` it."""
    varied = {
        f"connections.{x.name}": {"delay_jitter": x.delay_jitter, "loss": x.loss, "random delay": is_random(x.delay)}
        for x in system.connections
    }
    varied |= {
        f"components.{name}": {"sampling.jitter": one.sampling.jitter}
        for name, one in system.components.items()
        if one.sampling is not None
    }
    each = {
        place: [key for key, value in values.items() if value and f"{place}.{key}" not in but]
        for place, values in varied.items()
    }
    if found := some(f"{' and '.join(keys)} of {place}" for place, keys in each.items() if keys):
        inform(f"left out here: {found}; {includes}")


def longest_period(system: System) -> Fraction:
    """The longest period of sampled components, or the longest step where none is sampled [ns]."""
    return max(periods_of(system))


def hyperperiod_of(system: System) -> Fraction | None:
    """The hyperperiod of all sampled components [ns]; None: none within `LONGEST_HYPERPERIOD`."""
    periods = periods_of(system)
    found = hyperperiod(periods)
    return found if found <= LONGEST_HYPERPERIOD * max(periods) else None


def hyperperiod(periods: Sequence[Fraction]) -> Fraction:
    """The least common multiple of the periods; 1 where there are none."""
    denominator = math.lcm(*(period.denominator for period in periods))
    return Fraction(math.lcm(*(int(period * denominator) for period in periods)), denominator)


def periods_of(system: System) -> list[Fraction]:
    """The periods of sampled components, or the steps of all where none is sampled [ns]."""
    return [one.sampling.true_period for one in system.components.values() if one.sampling is not None] or [
        exact_nanoseconds(one.step) for one in system.components.values() if one.step is not None
    ]


def turn_of(system: System, period: float) -> float | None:
    """Whole turns in a period [s] of several rates [rad/s]: by multiples of it the frequency of a pole may be another.

    None: the period is that of the only rate.
    """
    return math.tau / period if period > 1.5 * float(min(periods_of(system))) / NANOSECONDS else None


def beside_others(
    at: Callable[[float], System], first: float, last: float, periods: Callable[[System], list[Fraction]] = periods_of
) -> tuple[list[Fraction], float] | None:
    """The other periods [ns] of a loop of which a quantity is one, and its value by nanosecond; None: it is none."""
    ends = list(zip(*(periods(at(value)) for value in (first, last))))
    others, varied = sorted({b for a, b in ends if a == b}), [b for a, b in ends if a != b]
    return (others, last / float(varied[0])) if varied and others else None


def latest_offset(system: System) -> Fraction:
    """True time of the first sample of the component that begins last [ns]."""
    samplings = (one.sampling for one in system.components.values())
    return max((each.true_offset for each in samplings if each is not None), default=Fraction(0))


def exchanged_signals(system: System) -> Sequence[str]:
    """The signals that connections carry."""
    return tuple(dict.fromkeys(start for x in system.connections for start in x.start))


def time_to_rest(system: System) -> float:
    """The time that a system runs before it is taken to rest at its operating point [s]."""
    return float(system.operating_point.get(AFTER, 0.0))


def expect_rest(
    system: System, calm: Floats, before: Floats, unit: Callable[[str], str | None] = lambda _: None
) -> None:
    """Raise `NotAnEquilibriumError` for an exchanged signal that changes; rows a period apart, shape (n, signals).

    `before`: likewise after half of the time that it has run to rest, or from its start on; `unit`: of a signal.
    """
    moved = _moved(calm)
    worst = int(moved.argmax())
    if moved[worst] <= AT_REST:
        return
    signal, after = exchanged_signals(system)[worst], time_to_rest(system)
    rows, of = np.concatenate([before, calm])[:, worst], unit(signal)
    if not after:
        first, farthest = (quantity(value, of, 4) for value in (rows[0], rows[np.abs(rows - rows[0]).argmax()]))
        none = "" if system.operating_point else ", of which there are none"
        raise NotAnEquilibriumError(
            f"the operating point is not at rest: {signal} goes from {first} at the start to {farthest}: expected "
            f"values in [operating_point] at which the system rests{none}, or {AFTER} = SECONDS there, which it runs "
            "to rest first; a state without a parameter may also begin at rest by its own code"
        )
    by, by_before = (quantity(_change(rows)[worst], of, 2) for rows in (calm, before))
    text = f"the operating point is not at rest after {after:g} s: {signal} moves by {by} in {len(calm) - 1} periods"
    if moved[worst] < 0.5 * _moved(before)[worst]:
        raise NotAnEquilibriumError(
            f"{text}, and by {by_before} earlier: expected a longer {AFTER} in [operating_point]"
        )
    raise NotAnEquilibriumError(
        f"{text}, no less than earlier: unstable here, or an oscillation, no rest: expected a loop that "
        f"settles, or without {AFTER} values in [operating_point] at which the system rests"
    )


def _change(rows: Floats) -> Floats:
    """By how much each signal changes."""
    change: Floats = np.abs(rows - rows[0]).max(axis=0)
    return change


def _moved(rows: Floats) -> Floats:
    """By how much each signal changes, relative where it is above 1."""
    return np.asarray(_change(rows) / np.maximum(1.0, np.abs(rows[0])))
