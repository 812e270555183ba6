"""What the search for a limit has found, value by value."""

from dataclasses import dataclass

from orchestration.limits.evaluation import Evaluation


@dataclass(frozen=True, kw_only=True)
class Continuous:
    """The same flight near continuous time, everything digital taken away: what it does is not due to sampling."""

    period: float
    """[s]"""
    outcome: str
    settling_time: float | None
    """[s]"""


@dataclass(frozen=True, kw_only=True, repr=False)
class Found:
    """The last value that is good (of the quadrotor: flies) and what it rests on; in the quantity's unit."""

    of: str
    """The quantity: a name, or a path."""
    unit: str | None = None
    """The unit of the quantity; None: it has none."""
    judged: str | None = None
    """The objective that the criterion is about; None: it is about none."""
    judged_unit: str | None = None
    """The unit of that objective; None: it has none."""
    judged_bound: float | None = None
    """Where the criterion draws the line in that objective, in its unit; None: it is no plain bound."""
    local_limit: float | None
    """Where what is small about the operating point (hover) first ceases to decay, in the quantity's unit; None: it is
    not defined, or not reached."""
    local_method: str | None = None
    """How that was found; None: it was not."""
    local_accuracy: float | None = None
    """How accurate it is, in its unit, as far as the method knows."""
    local_limit_outside: float | None
    """Of the quadrotor likewise, with the gain that the law has just outside its boundary layer; None also without such
    a layer."""
    mean_square_limit: float | None = None
    """With something random where means of squares first have no finite expectation, of the loop about its operating
    point, in the quantity's unit; None: nothing is random, or there is none in the range, or it cannot be had."""
    large_signal_limit: float | None
    """The last value that is good from the scenario's own initial state, in the quantity's unit; None: nothing in the
    range failed, or the first value did."""
    refuted_limit: float | None
    """For random quantities the lowest value found at which so many seeds do not fly that `RELIABILITY` is refuted at
    the confidence; None: nothing is random, or none in the range."""
    follows: str = ""
    """What is followed, and by whom; empty where nothing is."""
    horizon: float
    """The stop time [s]: what does not settle by it does not fly."""
    tolerance: float
    """The width of the last bracket, in the quantity's unit."""
    scan: float
    """The step of the scan, in the quantity's unit; what flies or fails between two of its values is not seen."""
    confidence: float | None
    """The confidence that at least `RELIABILITY` of all seeds fly, of each value, not of the search; None: nothing is
    random."""
    seeds: int
    """How many runs each value takes, all of which must fly."""
    flies_above: tuple[float, ...]
    """Values tried above the limit that fly again."""
    continuous: Continuous | None
    """The same flight near continuous time; None: it was not asked for."""
    tried: tuple[Evaluation, ...]
    """All values that were flown, upward."""
    note: str
    """What the figures mean together, in a sentence."""
