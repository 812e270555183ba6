"""Local limits: where what is small about an operating point ceases to decay."""

from dataclasses import dataclass

from orchestration.errors import UsageError
from orchestration.fmi.reuse import Instances
from orchestration.quadrotor.scenario import Scenario
from orchestration.studies.linear import HoverLoop, at_edge
from orchestration.studies.ranges import Range, Varied, range_of
from orchestration.studies.search import first_failure
from orchestration.studies.twins import growth_of

LINEAR = "spectral radius of the sampled loop about hover, by differences through saved states"
LINEAR_ACCURACY = 1e-3
"""of the limit, relative: what the differences leave"""
TWINS = "growth of the difference of twin runs from the operating point, one of them struck by a pulse"
FINER = 0.2
"""of the tolerance of the measured limit"""


@dataclass(frozen=True, kw_only=True)
class Local:
    """A local limit, None where there is none, and why."""

    limit: float | None = None
    outside: float | None = None
    """of the quadrotor: with the gain just outside of its boundary layer"""
    method: str | None = None
    accuracy: float | None = None
    reason: str


def local_limit(loop: HoverLoop, scenario: Scenario, of: str) -> float | None:
    """Where the spectral radius first crosses one from below, in period or delay [s]; None: nowhere in the range."""
    span = range_of(scenario, of)
    low = min((*span.before, span.first))
    fine = [low + 0.001 * i for i in range(int((span.last - low) / 0.001))]
    bracket = first_failure(lambda value: radius(loop, scenario, of, value) >= 1.0, fine, 1e-6)
    return bracket.good if bracket is not None else None


def radius(loop: HoverLoop, scenario: Scenario, of: str, value: float) -> float:
    """The spectral radius of `scenario` about hover with another period or delay [s]."""
    timing = scenario.timing
    period = (value if of == "period" else timing.period) / timing.clock_ratio
    delay = (value if of == "delay" else timing.delay) + (period if timing.order == "jacobi" else 0.0)
    return loop.spectral_radius(period, delay)


def local_limits(varied: Varied, span: Range) -> Local:
    """The local limit of a quantity: of the quadrotor by linear theory, of any other system by perturbed twin runs."""
    if isinstance(varied.request, Scenario):
        return about_hover(varied.request, varied.of)
    if not varied.system.operating_point:
        return Local(reason="no local limit: the system file names no operating_point")
    return _by_twins(varied, span)


def about_hover(scenario: Scenario, of: str) -> Local:
    """The local limits of the quadrotor by linear theory, inside its boundary layer and just outside of it."""
    if of not in ("period", "delay"):
        return Local(reason=f"linear theory has no local limit of {of}")
    if scenario.timing.hold != "zero":
        return Local(reason="the linear loop is for zero-order hold only")
    try:
        loop = HoverLoop.of(scenario)
    except UsageError as error:
        return Local(reason=str(error))
    edge = at_edge(scenario)
    limit = local_limit(loop, scenario, of)
    return Local(
        limit=limit,
        outside=None if edge is None else local_limit(loop.with_law(edge), edge, of),
        method=LINEAR,
        accuracy=None if limit is None else LINEAR_ACCURACY * limit,
        reason="the spectral radius about hover stays below one in the range, or above",
    )


def _by_twins(varied: Varied, span: Range) -> Local:
    """By the growth of the difference of twin runs, up through the scan, and bisected."""
    width, instances = span.tolerance * FINER, Instances()
    try:
        bracket = first_failure(lambda value: growth_of(varied.at(value), instances).rate > 0.0, span.values(), width)
    except UsageError as error:
        return Local(reason=f"no local limit: {error}")
    finally:
        instances.close()
    if bracket is None or bracket.good is None:
        return Local(
            method=TWINS, reason=f"what is small {'decays' if bracket is None else 'grows'} throughout the range"
        )
    return Local(limit=0.5 * (bracket.good + bracket.bad), method=TWINS, accuracy=width, reason="")
