"""Local limits: where the sampled loop about hover ceases to be stable, by its spectral radius."""

from orchestration.errors import UsageError
from orchestration.scenario import Scenario
from orchestration.studies.linear import HoverLoop, at_edge
from orchestration.studies.ranges import range_of
from orchestration.studies.search import first_failure


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


def local_limits(scenario: Scenario, of: str) -> tuple[float | None, float | None, str]:
    """The local limits inside the boundary layer and just outside of it, None where there is none, and why."""
    if of not in ("period", "delay"):
        return None, None, f"linear theory has no local limit of {of}"
    if scenario.timing.hold != "zero":
        return None, None, "the linear loop is for zero-order hold only"
    try:
        loop = HoverLoop.of(scenario)
    except UsageError as error:
        return None, None, str(error)
    edge = at_edge(scenario)
    outside = None if edge is None else local_limit(loop.with_law(edge), edge, of)
    reason = "the spectral radius about hover stays below one in the range, or above"
    return local_limit(loop, scenario, of), outside, reason
