"""The result of the search for a limit, with all evaluated values."""

from dataclasses import dataclass

from orchestration.experiments.limits.evaluation import Evaluation


@dataclass(frozen=True, kw_only=True)
class ContinuousRun:
    """The same flight near continuous time, without digital effects, to show what is not due to sampling."""

    period: float
    """[s]"""
    outcome: str
    settling_time: float | None
    """[s]"""


@dataclass(frozen=True, kw_only=True, repr=False)
class LimitResult:
    """The last good value of a quantity and the evidence for it, in the quantity's unit."""

    of: str
    """The quantity: a name, or a path."""
    unit: str | None = None
    """The unit of the quantity; None: it has none."""
    judged: str | None = None
    """The objective that the criterion judges; None: it judges none."""
    judged_unit: str | None = None
    """The unit of that objective; None: it has none."""
    judged_bound: float | None = None
    """The criterion's bound on that objective, in its unit; None: it has no plain bound."""
    local_limit: float | None
    """The value from which small errors about the operating point (hover) no longer decay; None: it is not defined, or
    not reached."""
    local_method: str | None = None
    """The method by which it was determined; None: it was not."""
    local_accuracy: float | None = None
    """Its accuracy, as far as the method provides it."""
    local_limit_outside: float | None
    """Likewise for the quadrotor, with the gain that the law has just outside its boundary layer; None also without
    such a layer."""
    mean_square_limit: float | None = None
    """The value from which mean squares of the loop about its operating point have no finite expectation; None: nothing
    is random, or there is no such value in the range, or it cannot be determined."""
    large_signal_limit: float | None
    """The last value that is good from the scenario's own initial state; None: no value in the range failed, or the
    first did."""
    refuted_limit: float | None
    """For random quantities, the lowest evaluated value at which so many seeds fail that `RELIABILITY` is refuted at
    the confidence; None: nothing is random, or there is none in the range."""
    follows: str = ""
    """The references and the components that follow them; empty if there are none."""
    horizon: float
    """The stop time [s], by which the criterion must be met."""
    tolerance: float
    """The width of the last bracket."""
    scan: float
    """The step of the scan; good or bad intervals between two of its values are not seen."""
    confidence: float | None
    """The confidence, for each value (not for the search), that at least `RELIABILITY` of all seeds are good; None:
    nothing is random."""
    seeds: int
    """The number of runs for each value, all of which must be good."""
    flies_above: tuple[float, ...]
    """Evaluated values above the limit that are good again."""
    continuous: ContinuousRun | None
    """The same flight near continuous time; None: not requested."""
    tried: tuple[Evaluation, ...]
    """All evaluated values, in rising order."""
    note: str
    """A summary in one sentence."""
