"""The largest period, delay, jitter or loss that still flies: measured, and beside it what linear theory says."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Literal, get_args

from orchestration.errors import UsageError
from orchestration.scenario import Scenario
from orchestration.studies.engine import Pool
from orchestration.studies.linear import HoverLoop
from orchestration.studies.study import changed, locate_fmus

Quantity = Literal["period", "delay", "jitter", "loss"]

RELIABILITY = 0.9
"""For random quantities: the share of seeds that fly, which the stated confidence is in."""
GAP = 0.1
"""of the local limit: a larger difference to the large-signal one is worth saying"""


@dataclass(frozen=True, kw_only=True)
class Range:
    """How a quantity is scanned: `before`, then from `first` in steps to `last`; then bisected to `tolerance`."""

    before: tuple[float, ...] = ()
    first: float
    step: float
    last: float
    tolerance: float
    unit: str = " s"


@dataclass(frozen=True, kw_only=True)
class Limit:
    """The last value that flies and what it rests on; in seconds, a loss as a probability."""

    of: str
    local_limit: float | None
    """where the spectral radius about hover first crosses one from below; None: not defined, or not reached"""
    large_signal_limit: float | None
    """from the scenario's own initial state; None: nothing in the range failed, or the first value did"""
    tolerance: float
    confidence: float | None
    """that at least `RELIABILITY` of all seeds fly; None: nothing is random"""
    seeds: int
    """runs for each value, all of which must fly"""
    note: str
    """what the figures mean together"""


def flies(metrics: dict[str, Any]) -> bool:
    """The criterion: settled, which is not diverged and within 5 cm in the last third of the run."""
    return bool(metrics["outcome"] == "settled")


def find(
    scenario: Scenario,
    of: str,
    *,
    tolerance: float | None = None,
    confidence: float = 0.95,
    workers: int = 1,
    announce: Callable[[str], None] | None = None,
) -> Limit:
    """The limit of `scenario` in one quantity, all else as it is.

    Raises `UsageError` for a quantity, tolerance or confidence that cannot be.
    """
    if of not in get_args(Quantity):
        raise UsageError(f"--of {of}: expected one of {', '.join(get_args(Quantity))}")
    span = range_of(scenario, of)
    tolerance = span.tolerance if tolerance is None else tolerance
    if not tolerance > 0.0:
        raise UsageError(f"--tolerance {tolerance}: expected a positive number")
    if not 0.0 < confidence < 1.0:
        raise UsageError(f"--confidence {confidence}: expected a number between 0 and 1")
    random = of in ("jitter", "loss") or not scenario.timing.is_deterministic()
    seeds = math.ceil(math.log(1.0 - confidence) / math.log(RELIABILITY)) if random else 1
    local, reason = _local(scenario, of)
    with Pool(locate_fmus(scenario), workers) as pool:

        def fails(value: float) -> bool:
            varied = changed(scenario, {f"timing.{of}": value})
            runs = [varied.with_changes(seed=scenario.seed + i) for i in range(seeds)]
            failed = not all(flies(metrics) for metrics in pool.fly(runs, stop=lambda metrics: not flies(metrics)))
            if announce is not None:
                announce(f"{of} {value:.6g}{span.unit}: {'fails' if failed else 'flies'}")
            return failed

        bracket = first_failure(fails, _scan(span), tolerance)
    large = bracket[0] if bracket is not None else None
    return Limit(
        of=of, local_limit=local, large_signal_limit=large, tolerance=tolerance,
        confidence=confidence if random else None, seeds=seeds, note=_note(span, bracket, local, reason),
    )  # fmt: skip


def first_failure(
    fails: Callable[[float], bool], values: Sequence[float], tolerance: float
) -> tuple[float | None, float] | None:
    """The last value that does not fail and the first that does, at most `tolerance` apart.

    Goes up through `values` and bisects the first bracket that fails; the set that does not fail need not
    be an interval. None if none fails; a first part of None if the first value does.
    """
    good = None
    for value in values:
        if not fails(value):
            good = value
            continue
        if good is None:
            return None, value
        bad = value
        while bad - good > tolerance:
            middle = 0.5 * (good + bad)
            if fails(middle):
                bad = middle
            else:
                good = middle
        return good, bad
    return None


def range_of(scenario: Scenario, of: str) -> Range:
    """The range in which a quantity of this scenario is looked for."""
    period = scenario.timing.period
    if of == "period":
        shortest = scenario.timing.jitter * scenario.timing.clock_ratio
        before = tuple(value for value in (0.001, 0.002, 0.003, 0.004) if value > shortest)
        first = 0.005 * (math.floor(shortest / 0.005) + 1)
        return Range(before=before, first=first, step=0.005, last=0.5, tolerance=0.0005)
    if of == "delay":
        return Range(first=0.0, step=0.005, last=0.5, tolerance=0.0005)
    if of == "jitter":
        return Range(first=0.0, step=period / 10.0, last=0.999 * period, tolerance=period / 100.0)
    length = scenario.timing.burst_length
    return Range(first=0.0, step=0.05, last=1.0 if length is None else length / (length + 1.0), tolerance=0.01, unit="")


def local_limit(loop: HoverLoop, scenario: Scenario, of: str) -> float | None:
    """Where the spectral radius first crosses one from below, in period or delay [s]; None: nowhere in the range."""
    span = range_of(scenario, of)
    low = min((*span.before, span.first))
    fine = [low + 0.001 * i for i in range(int((span.last - low) / 0.001))]
    bracket = first_failure(lambda value: radius(loop, scenario, of, value) >= 1.0, fine, 1e-6)
    return bracket[0] if bracket is not None else None


def radius(loop: HoverLoop, scenario: Scenario, of: str, value: float) -> float:
    """The spectral radius of `scenario` about hover with another period or delay [s]."""
    timing = scenario.timing
    period = (value if of == "period" else timing.period) / timing.clock_ratio
    delay = (value if of == "delay" else timing.delay) + (period if timing.order == "jacobi" else 0.0)
    return loop.spectral_radius(period, delay)


def _local(scenario: Scenario, of: str) -> tuple[float | None, str]:
    """The local limit, or None and why there is none."""
    if of not in ("period", "delay"):
        return None, f"linear theory has no local limit of {of}"
    if scenario.timing.hold != "zero":
        return None, "the linear loop is for zero-order hold only"
    try:
        loop = HoverLoop.of(scenario)
    except UsageError as error:
        return None, str(error)
    return local_limit(loop, scenario, of), "the spectral radius about hover stays below one in the range, or above"


def _scan(span: Range) -> list[float]:
    count = math.floor((span.last - span.first) / span.step + 1e-9)
    return [*span.before, *(float(f"{span.first + i * span.step:.12g}") for i in range(count + 1))]


def _note(span: Range, bracket: tuple[float | None, float] | None, local: float | None, reason: str) -> str:
    if bracket is None:
        measured = f"flies throughout the range, to {span.last:g}{span.unit}"
    elif bracket[0] is None:
        measured = f"does not fly at {bracket[1]:g}{span.unit}, the first value of the range"
    else:
        measured = f"flies at {bracket[0]:.6g}{span.unit} and not at {bracket[1]:.6g}{span.unit}"
    if local is None:
        return f"{measured}; {reason}"
    if bracket is None or bracket[0] is None or abs(bracket[0] - local) > GAP * local:
        return f"{measured}; more than a tenth from the local limit of {local:.6g}{span.unit}: large signals decide"
    return f"{measured}; within a tenth of the local limit of {local:.6g}{span.unit}"
