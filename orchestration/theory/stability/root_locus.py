"""The poles of a sampled loop over a quantity, and where they cross the unit circle."""

import math
import re
from collections.abc import Callable
from contextlib import closing, suppress
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import TYPE_CHECKING, Literal

import numpy as np

from orchestration.components.fmi.foreign_calls import isolated_call
from orchestration.components.fmi.reuse import Instances
from orchestration.foundation.basics.bisection import Bracket, Range, is_wide
from orchestration.foundation.basics.errors import UsageError
from orchestration.foundation.basics.extras import explains_missing
from orchestration.foundation.basics.simulator import Floats
from orchestration.foundation.basics.terminal import progress_bar
from orchestration.foundation.basics.times import NANOSECONDS, exact_nanoseconds
from orchestration.foundation.basics.unit_algebra import quantity, some
from orchestration.foundation.processes.passable import passable
from orchestration.simulation.requests.ranges import Varied, default_quantity, search_range
from orchestration.simulation.requests.request import RequestLike, request_of
from orchestration.simulation.workers.choice import single_run_execution
from orchestration.systems.system.distribution import lowest
from orchestration.systems.system.files import files_of
from orchestration.systems.system.model import System
from orchestration.systems.system.paths import changed
from orchestration.systems.system.request import errors_in_own_terms
from orchestration.theory.stability.delay_margin import MOST_JUMPS, SIDES, apart_of
from orchestration.theory.stability.fixed_periods import in_repeated_periods
from orchestration.theory.stability.in_double import are_in_double, of_code
from orchestration.theory.stability.known_loops import rested, warned_of_timing
from orchestration.theory.stability.loop_at_rest import KnownTangents, Start, keep_start, whole_at_rest
from orchestration.theory.stability.operating_point import (
    NotAnEquilibriumError,
    inform_of_chance,
    longest_period,
    turn_of,
)
from orchestration.theory.stability.period_map import OTHER_PULSE, growth_of_loop, period_map
from orchestration.theory.stability.poles import Complexes, in_words, or_alias, poles_of
from orchestration.theory.stability.several_rates import Commensurate, commensurate, narrowed
from orchestration.theory.stability.sign_changes import short, uncertainty, zero_between

if TYPE_CHECKING:
    from orchestration.simulation.figures.style import Figures

COUNT = 40
"""Values by default"""
SHARE = 0.2
"""Share of the range of a limit by default, farther than which nearly all loops have long left the circle"""
MAX_COUNT = 10_000
ALIKE = 1e-8
"""Distance of the two sides of a jump of a delay, at most [s]"""
ON_CIRCLE = 1e-5
"""Distance of a pole from the circle, from which it has jumped across"""
ROUNDING = float(np.finfo(float).tiny)
DIGITS, FEW = 6, 4
"""Digits of its values in a sentence, at most, and where it is not known how many hold"""
_NUMBERS = re.compile(r"\d+(\.\d+)?(e[+-]?\d+)?( [nµm]?s\b)?")
"""Numbers in a reason, with their units of time: reasons that differ in them alone are of one kind"""


@passable
@dataclass(frozen=True, kw_only=True)
class Crossing:
    """A value at which poles cross the unit circle, or beyond which they have jumped across it."""

    value: float
    """Its value, in the unit of the quantity: where they jump, the last one at which the loop is stable."""
    until: float
    """The nearest value that was tried on the other side, up to which they have crossed; the same where none jump."""
    leaves: bool
    """Whether the loop is unstable above it; else below."""
    z: complex
    """The pole on the circle, or the one that has jumped out of it; of a pair the upper one."""
    frequency: float
    """Its frequency [rad/s]: 0 of a pole at 1, half the sampling rate of one at -1."""
    turn: float | None = None
    """Whole turns in the common period of several rates [rad/s]: by multiples of it the frequency may be another; None:
    one rate"""
    accuracy: float | None = None
    """Error of the value, as pulses of another size show; None: not known, or poles jump"""

    @property
    def jumps(self) -> bool:
        """Whether poles jump across the circle there: no value has one on it."""
        return abs(abs(self.z) - 1.0) > ON_CIRCLE

    @property
    def ends(self) -> tuple[float, ...]:
        """Its value, or in rising order the two between which it is, as where rates repeat together."""
        ends = tuple(sorted((self.value, self.until)))
        alike = math.isclose(*ends, abs_tol=ALIKE) or len({f"{end:.{self.digits}g}" for end in ends}) == 1
        return ends[:1] if alike else ends

    @property
    def digits(self) -> int:
        """The digits of its value that hold."""
        if self.jumps or not self.accuracy or not self.value:
            return DIGITS if self.jumps or self.accuracy == 0.0 else FEW
        places = math.floor(math.log10(abs(self.value))) - math.ceil(math.log10(2.0 * self.accuracy))
        return min(DIGITS, max(1, places + 1))


@passable
@dataclass(frozen=True, kw_only=True)
class RootLocus:
    """The poles of a loop about its operating point, closed, over a period of its clock, for values of a quantity."""

    of: str
    """The quantity: a name, or a path."""
    unit: str | None
    """The unit of the quantity; None: it has none."""
    values: Floats
    """Values of the quantity, in rising order, shape (n,); the file's own is one of them where it lies in the range."""
    radius: Floats
    """The spectral radius at each, shape (n,): below 1 small deviations decay. Of a period beside others it is per
    longest period, for that of all rates differs from value to value."""
    poles: Complexes = field(repr=False)
    """The poles at each, shape (n, m), without those at 0, of what is forgotten; where there are fewer, NaN."""
    crossings: tuple[Crossing, ...]
    """Values at which poles cross the unit circle, in rising order."""
    geometric: bool = False
    """Whether values are of a geometric sequence, as over more than a decade."""
    own: float | None = None
    """Value of the file; None: it lies outside, or there is none."""
    curve: Floats = field(repr=False)
    """All values that were tried, also beside jumps, and the spectral radius at each, shape (2, k); NaN: no poles."""
    in_double: tuple[str, ...] = ()
    """The components whose float code in C is taken in double precision."""
    without: tuple[str, ...] = ()
    """The values tried that have no poles, in rising order, and why each: where the loop has no rest, say."""
    moved: int = 0
    """The number of values asked for that are replaced by others, at which several rates repeat together."""
    asked: int | None = None
    """The number of values asked for, of a period beside others; None: of another quantity, of which all are tried."""

    def __repr__(self) -> str:
        return f"<RootLocus: {self.verdict}>"

    @property
    def verdict(self) -> str:
        """Where poles leave the unit circle and return, or that they do not; and where there are none, and why."""

        def shown(value: float) -> str:
            return quantity(value, self.unit, DIGITS)

        first, last = shown(self.values[0]), shown(self.values[-1])
        known = f"(small deviations{of_code(self.in_double)})"
        if self.without:
            kinds = dict[str, list[str]]()
            for one in self.without:
                kinds.setdefault(_NUMBERS.sub("", one), []).append(one)
            reasons = [
                f"{len(alike)}{'' if k else f' of {self.tried} values tried'}, as {alike[0]}"
                for k, alike in enumerate(kinds.values())
            ]
            known += f"; no poles at {some(reasons, '; at ')}"
        if self.asked is not None:
            known += f"; {self.tried} values examined, at which all rates repeat together"
            known += " after twenty times the longest period at most"
            known += (
                f": of {self.asked} asked for {self.moved} are no such, others near by stand in" if self.moved else ""
            )
            known += "; stable or unstable windows between values examined are not seen"
        begins = "inside" if self.radius[0] < 1.0 else "not all inside"
        if not self.crossings:
            radii = f"spectral radius {self.radius.min():.4g} to {self.radius.max():.4g}"
            alike, many = int(((self.radius < 1.0) == (self.radius[0] < 1.0)).sum()), len(self.values)
            each = f"{'each' if alike == many else alike} of {many} values from {first} to {last}"
            return f"{self.of}: poles {begins} the unit circle at {each}, {radii} {known}"
        ways = [f"{'leave' if one.leaves else 'return'} {self.place_of(one)}" for one in self.crossings]
        return f"{self.of}: poles {begins} the unit circle at {first}, {some(ways, '; ')} {known}"

    @property
    def tried(self) -> int:
        """How many values were tried, those included between which poles cross."""
        return len(self.curve[0])

    def place_of(self, crossing: Crossing) -> str:
        """Where poles cross, in words: at a value, with the frequency, or between two where rates repeat together."""
        ends = [quantity(value, self.unit, crossing.digits) for value in crossing.ends]
        if len(ends) > 1:
            return f"between {' and '.join(ends)}"
        return f"at {ends[0]}, {crossing.frequency:.4g} rad/s{or_alias(crossing.turn)}"

    def pole_of(self, crossing: Crossing) -> str:
        """The pole on the circle, in words; of those that jump one outside, with its size and the value it is of."""
        beyond = f" at {quantity(crossing.until, self.unit, DIGITS)}, |z| = {abs(crossing.z):.4g}"
        return f"{in_words(crossing.z)}{beyond if crossing.jumps else ''}"

    @explains_missing
    def plot(self, *, style: Literal["screen", "paper", "slides"] = "screen") -> "Figures":
        """The poles beside the unit circle, and the spectral radius over the quantity; a notebook shows them.

        `style` sets sizes and fonts. Raises `UsageError` for an unknown style.
        """
        from orchestration.simulation.figures.style import Figures, style_named
        from orchestration.theory.stability.loop_figures import locus_figure

        chosen = style_named(style)
        with chosen.applied():
            return Figures({"locus": locus_figure(self, chosen)}, chosen)


def locus(
    request: RequestLike,
    of: str | None = None,
    *,
    first: float | None = None,
    last: float | None = None,
    count: int | None = None,
) -> RootLocus:
    """The poles of a loop about its operating point, for values of a quantity from `first` to `last`.

    Quantities are those of `limit`: `of` is a path, or for the quadrotor `period` or `delay`; default: the period of
    the only sampled component. By default the range is the first fifth of that of `limit`: periods from half to ten
    times that of the file, delays up to ten periods or twice that of the file. Values are `count`, default 40, evenly
    spaced, over more than a decade by equal factors, and the file's own. A period beside others has poles where all
    rates repeat together after twenty times the longest at most: another value is moved to the multiple of most others
    within half of the way to the next, else to the nearest, and crossings are between two such. Holds and delays are
    included; jitter, loss, noise and quantisation are left out. A pair of crossings between two neighbouring values is
    not seen, but for jumps of a delay to a sampled component: both sides of each are tried.

    Raises `UsageError` for an invalid quantity or range, and as `linearise` where no value has poles.
    """
    if count is not None and not 2 <= count <= MAX_COUNT:
        raise UsageError(f"--count {count}: expected a number from 2 to {MAX_COUNT}")
    loaded, _ = single_run_execution(request_of(request), "auto")
    varied = Varied(request=loaded, of=of or default_quantity(loaded))
    files = files_of(varied.system)
    span = search_range(
        varied, files.models_of(varied.system), first=first, last=last, tolerance=None, scan=None, share=SHARE
    )
    inform_of_chance(varied.system)
    ends = varied.at(span.values()[0]), varied.at(span.last)
    with warned_of_timing(varied.system, files, ends):
        return isolated_call(files.fmus.values(), _root_locus, varied, span, count)


def _spaced(span: Range, count: int, spaced: Callable[[float, float, int], Floats]) -> list[float]:
    return [short(float(value), span.unit) for value in spaced(span.values()[0], span.last, count)]


class _Tried:
    """The poles of a loop at values of a quantity, each measured once, and where they cross the unit circle."""

    def __init__(self, varied: Varied, system: System, instances: Instances, unit: str | None) -> None:
        self._varied, self._system, self._instances, self._unit = varied, system, instances, unit
        self.known, self._starts = KnownTangents(), dict[float, Start | None]()
        self.rates: Commensurate | None = None
        """Values at which all rates meet; None: one rate"""
        self.found: dict[float, tuple[Complexes, float]] = {}
        """Poles by value, and the period [s] that they are over"""
        self.without: dict[float, UsageError] = {}
        """Why values have none"""
        self.progress: Callable[[], None] = lambda: None
        """Called after each value"""
        with suppress(UsageError):  # of one that is unstable, values from which it is stable may follow
            keep_start(system, instances, self.known)

    def at(self, value: float) -> System:
        """The system at a value."""
        return changed(self._system, dict.fromkeys(self._varied.paths, value))

    def radius(self, value: float) -> float:
        """The spectral radius, among several rates per longest period; raises `UsageError` where there are no poles."""
        if value not in self.found:
            self._measure(value)
        poles, period = self.found[value]
        share = 1.0 if self.rates is None else float(longest_period(self.at(value))) / NANOSECONDS / period
        return float(np.abs(poles).max(initial=0.0) ** share)

    def _measure(self, value: float) -> None:
        try:
            if self._starts:
                self.known.start = self._starts[min(self._starts, key=lambda one: abs(one - value))]
            with whole_at_rest(self.at(value), self._instances, known=self.known) as loop:
                self.found[value] = poles_of(period_map(loop)), float(loop.period) / NANOSECONDS
        except UsageError as error:
            raise type(error)(f"{self._varied.of} = {value:g}: {error}") from None
        self._starts[value] = self.known.start
        self.progress()

    def has_poles(self, value: float) -> bool:
        """Whether there are poles at a value; else `without` has the reason."""
        try:
            self.radius(value)
        except UsageError as error:
            self.without[value] = error
            return False
        self.without.pop(value, None)
        return True

    def crossing(self, below: float, above: float) -> Crossing | None:
        """Where poles cross between two values that have some; None: they do not. Others without any are left out."""
        if (self.radius(below) < 1.0) == (self.radius(above) < 1.0):
            return None
        inside, outside = sorted((below, above), key=self.radius)
        if self.rates is not None:
            narrowed(self._is_outside, Bracket(inside, outside), self.rates)
        else:
            ends = ((below, self.radius(below) - 1.0), (above, self.radius(above) - 1.0))
            inside, outside = zero_between(
                lambda x: self.radius(x) - 1.0 if self.has_poles(x) else math.nan,
                lambda x: short(x, self._unit),
                *ends,
            )
        poles, period = self.found[outside]
        pole = complex(max(poles, key=lambda one: (round(abs(one), 9), one.imag)))
        one = Crossing(
            value=inside, until=outside, leaves=self.radius(below) < 1.0, z=pole,
            frequency=abs(math.atan2(pole.imag, pole.real)) / period,
            turn=turn_of(self.at(outside), period),
        )  # fmt: skip
        return one if one.jumps else replace(one, accuracy=self._accuracy_of(one))

    def _is_outside(self, value: float) -> bool | None:
        is_known = value not in self.without and self.has_poles(value)
        return self.radius(value) >= 1.0 if is_known else None

    def _accuracy_of(self, one: Crossing) -> float | None:
        growths = {value: math.log(max(self.radius(value), ROUNDING)) / self.found[value][1] for value in self.found}
        growth = growths[one.until]
        try:
            error = abs(growth_of_loop(self.at(one.until), self._instances, OTHER_PULSE, self.known) - growth)
        except UsageError:
            return None
        accuracy = uncertainty(growths, one.value, error + abs(growth)) + abs(one.until - one.value)
        return accuracy if math.isfinite(accuracy) else None


def _crossings(loop: _Tried, tried: list[float], own: float | None) -> list[Crossing]:
    """Where poles cross, in rising order; raises `UsageError` where no value has poles."""
    crossings = dict[tuple[float, float], Crossing | None]()
    done = 0.0
    with progress_bar("poles") as report:
        loop.progress = lambda: report(done)
        # Downward, each crossing at once: the tangent of a plant in a long period holds in shorter ones.
        first = (tried[-1], own if own in tried else tried[0], tried[0])
        differs = loop.at(tried[0]).uses_scheduler  # whether a schedule repeats, from value to value
        if not (
            any(map(loop.has_poles, first)) or differs or isinstance(loop.without[first[2]], NotAnEquilibriumError)
        ):
            raise loop.without[tried[-1]]
        for place in range(len(tried) - 2, -1, -1):
            pair = tried[place], tried[place + 1]
            if loop.has_poles(pair[0]) and pair[1] in loop.found:
                crossings[pair] = loop.crossing(*pair)
            done = 1.0 - place / len(tried)
        if not loop.found:
            raise loop.without[tried[-1]]
        for below, value in pairwise(tried):  # near a rest that is known now
            if below in loop.found and value in loop.without:
                loop.has_poles(value)
        for pair in pairwise(value for value in tried if value in loop.found):
            if pair not in crossings:
                crossings[pair] = loop.crossing(*pair)
        known_before = 0
        while loop.rates is not None and known_before < len(loop.found):  # narrowing may have found others between
            known_before = len(loop.found)
            crossings = {pair: loop.crossing(*pair) for pair in pairwise(sorted(loop.found))}
    return sorted((one for one in crossings.values() if one is not None), key=lambda one: one.value)


def _root_locus(varied: Varied, span: Range, count: int | None) -> RootLocus:
    with errors_in_own_terms(varied.request), closing(Instances()) as instances:
        own, system = span.own, rested(varied.request)
        loop = _Tried(varied, system, instances, span.unit)

        def with_own(values: list[float]) -> list[float]:
            if own is None or not values[0] < own < values[-1]:
                return values
            return sorted([own, *(value for value in values if not math.isclose(value, own))])

        geometric = is_wide(span.values()[0], span.last)
        every = with_own(_spaced(span, count or COUNT, np.geomspace if geometric else np.linspace))
        loop.rates = commensurate(loop.at, every, instead=True)
        values = every if loop.rates is None else loop.rates.scan
        if not values:
            raise UsageError(f"{varied.of}: several rates, which repeat together at no value of the range")
        crossings = _crossings(loop, _beside_jumps(varied, system, values), own)
    values = [value for value in values if value in loop.found]
    each = [loop.found[value][0] for value in values]
    poles = np.full((len(values), max(map(len, each))), np.nan, dtype=complex)
    for row, known_poles in zip(poles, each, strict=True):
        row[: len(known_poles)] = known_poles
    tried = sorted(loop.found.keys() | loop.without.keys())
    return RootLocus(
        of=varied.of, unit=span.unit, own=own if own in values else None, values=np.array(values),
        radius=np.array([loop.radius(value) for value in values]), geometric=geometric, poles=poles,
        crossings=tuple(crossings),
        curve=np.array([(x, loop.radius(x) if x in loop.found else math.nan) for x in tried]).T,
        in_double=are_in_double({name: one for name, (one, _, _) in loop.known.items()}),
        without=tuple(str(loop.without[value]) for value in sorted(loop.without)),
        moved=0 if loop.rates is None else loop.rates.moved, asked=None if loop.rates is None else len(every),
    )  # fmt: skip


def _beside_jumps(varied: Varied, system: System, values: list[float]) -> list[float]:
    """The values, and those to both sides of each jump between them, of a delay to a sampled component."""
    found, (first, last) = set(values), (values[0] * NANOSECONDS, values[-1] * NANOSECONDS)
    calm = in_repeated_periods(system)
    for own, x in zip(system.connections, calm.connections):
        apart = apart_of(calm, x) if f"connections.{x.name}.delay" in varied.paths else None
        if apart is None or (last - first) * len(apart.delays) > MOST_JUMPS * apart.interval:
            continue
        before = exact_nanoseconds(lowest(x.delay)) - exact_nanoseconds(lowest(own.delay))
        least = [(each - before) % apart.interval for each in apart.delays]
        counts = range(math.floor(last / apart.interval) + 1)
        jumps = (float(each + k * apart.interval) / NANOSECONDS for each in least for k in counts)
        sides = (round(jump + side, 9) for jump in jumps for side in SIDES)
        found.update(side for side in sides if values[0] <= side <= values[-1])
    return sorted(found)
