"""Local limits: where what is small about an operating point ceases to decay."""

from collections.abc import Callable
from dataclasses import dataclass, replace

from orchestration.basics.bisection import first_failure
from orchestration.basics.errors import SimulatorError, UsageError
from orchestration.fmi.reuse import Instances
from orchestration.quadrotor.scenario import Scenario
from orchestration.requests.ranges import Range, Varied, range_of
from orchestration.stability.hover_loop import HoverLoop, NotSmooth, at_edge, at_hover
from orchestration.stability.linearised_component import PULSE
from orchestration.stability.monodromy import growth_of_loop
from orchestration.stability.operating_point import NotAtRest
from orchestration.stability.perturbed_runs import growth_of
from orchestration.system.model import System
from orchestration.system.paths import changed

HOVER = "spectral radius of the sampled loop about hover, by differences through saved states"
HOVER_ACCURACY = 1e-3
"""of the limit, relative: what the differences leave"""
LOOP = "spectral radius of the sampled loop about the operating point, by differences through saved states"
LOOP_FINER, TWINS_FINER = 0.01, 0.2
"""of the tolerance of the measured limit"""
TWINS = "growth of the difference of twin runs from the operating point, one of them struck by a pulse"
OTHER_PULSE = 4.0
"""by which pulses differ whose limits are compared"""

Growth = Callable[[float], float]
"""Of what is small, by the value of the quantity [1/s]"""


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
    """The local limit of a quantity, through saved states where the FMUs have them, else by perturbed twin runs."""
    scenario = varied.request
    if not isinstance(scenario, Scenario):
        if not varied.system.operating_point:
            return Local(reason="no local limit: the system file names no operating_point")
        return about_rest(varied.at, span)
    if varied.of in ("jitter", "loss"):
        return Local(reason=f"linear theory has no local limit of {varied.of}")
    why = "the loop about hover is for period and delay only"
    try:
        if varied.of in ("period", "delay"):
            return about_hover(scenario, varied.of)
    except NotSmooth as error:
        return Local(reason=f"no local limit: {error}")
    except UsageError as error:
        why = str(error)
    return _without_hover_loop(scenario, varied, span, why)


def about_hover(scenario: Scenario, of: str) -> Local:
    """The local limits of the quadrotor in period or delay, inside its boundary layer and just outside of it.

    Raises `UsageError` for a scenario whose loop about hover cannot be had.
    """
    if scenario.timing.hold != "zero":
        raise UsageError("the loop about hover is for zero-order hold only")
    loop = HoverLoop.of(scenario)
    edge = at_edge(scenario)
    limit = local_limit(loop, scenario, of)
    return Local(
        limit=limit,
        outside=None if edge is None else local_limit(loop.with_law(edge), edge, of),
        method=HOVER,
        accuracy=None if limit is None else HOVER_ACCURACY * limit,
        reason="the spectral radius about hover stays below one in the range, or above",
    )


def _without_hover_loop(scenario: Scenario, varied: Varied, span: Range, why: str) -> Local:
    """The quadrotor as any other system, and why."""
    try:
        hover = at_hover(scenario)
    except UsageError as error:
        return Local(reason=f"no local limit: {error}")
    found = about_rest(lambda value: changed(hover, dict.fromkeys(varied.paths, value)), span)
    if found.method is None:
        return replace(found, reason=f"{found.reason} ({why})")
    return replace(found, method=f"{found.method} ({why})")


def about_rest(at: Callable[[float], System], span: Range) -> Local:
    """The local limit of any system, `at` each value of the quantity."""
    instances = Instances()
    try:
        return _through_saved_states(at, span, instances)
    except NotAtRest as error:
        return Local(reason=f"no local limit: {error}")
    except (UsageError, SimulatorError) as error:
        why = str(error)
    finally:
        instances.close()
    instances = Instances()
    try:
        found = _by_twins(at, span, instances)
    except (UsageError, SimulatorError) as error:
        return Local(reason=f"no local limit: {error}")
    finally:
        instances.close()
    return replace(found, method=f"{TWINS}, as saved states do not serve: {why}")


def _through_saved_states(at: Callable[[float], System], span: Range, instances: Instances) -> Local:
    """Its accuracy is what other pulses would make of it, beside the bracket."""
    growths: dict[float, float] = {}

    def growth(value: float) -> float:
        growths[value] = found = growth_of_loop(at(value), instances)
        return found

    found = _first_growth(growth, span, LOOP_FINER, LOOP)
    if found.limit is None or found.accuracy is None:
        return found
    below, above = (max(v for v in growths if v < found.limit), min(v for v in growths if v > found.limit))
    slope = (growths[above] - growths[below]) / (above - below)
    apart = abs(growth_of_loop(at(below), instances, OTHER_PULSE * PULSE) - growths[below])
    return replace(found, accuracy=found.accuracy + apart / slope)


def _by_twins(at: Callable[[float], System], span: Range, instances: Instances) -> Local:
    return _first_growth(lambda value: growth_of(at(value), instances).rate, span, TWINS_FINER, TWINS)


def _first_growth(growth: Growth, span: Range, finer: float, method: str) -> Local:
    """Where what is small first grows, up through the scan, and bisected."""
    width = span.tolerance * finer
    bracket = first_failure(lambda value: growth(value) > 0.0, span.values(), width)
    if bracket is None or bracket.good is None:
        return Local(
            method=method, reason=f"what is small {'decays' if bracket is None else 'grows'} throughout the range"
        )
    return Local(limit=0.5 * (bracket.good + bracket.bad), method=method, accuracy=width, reason="")
