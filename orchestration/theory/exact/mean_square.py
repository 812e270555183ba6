"""The value of a random quantity at and above which mean squares are infinite."""

from collections.abc import Mapping, Sequence

from orchestration.components.fmi.read_description import Model
from orchestration.foundation.basics.bisection import Range, ends_of_good
from orchestration.foundation.basics.errors import SimulatorError, UsageError
from orchestration.simulation.requests.ranges import Varied
from orchestration.systems.system.model import System
from orchestration.systems.system.paths import changed
from orchestration.theory.exact.loops import Loops
from orchestration.theory.stability.known_loops import LinearLimit, rested

LIMIT_TOLERANCE = 0.01
"""Share of the tolerance of a measured limit"""
RADIUS_TOLERANCE = 1e-6
"""Difference of a radius allowed from order to order"""


def mean_square_limit(varied: Varied, span: Range, models: Mapping[str, Model]) -> LinearLimit:
    """The first value of a quantity, up from the system's own, at which the mean-square radius of the loop is 1."""
    try:
        system = rested(varied.request)
        by_fmu = {component.fmu: models[name] for name, component in system.components.items()}
        return _crossing(system, varied.paths, span, Loops(by_fmu))
    except (UsageError, SimulatorError) as error:
        return LinearLimit(reason=f"no mean-square limit: {error}")


def _crossing(system: System, paths: Sequence[str], span: Range, loops: Loops) -> LinearLimit:
    def fails(value: float) -> bool:
        return loops.radius(changed(system, dict.fromkeys(paths, value)), agree=RADIUS_TOLERANCE) >= 1.0

    values = span.values()
    bracket = ends_of_good(fails, values, span.own, LIMIT_TOLERANCE * span.tolerance).upper
    if bracket is None:
        return LinearLimit(reason="second moments are bounded up to the end of the range")
    if bracket.good is None:
        return LinearLimit(
            reason=f"second moments grow without bound at {values[0]:.6g}{span.unit}, where the scan begins"
        )
    return LinearLimit(limit=0.5 * (bracket.good + bracket.bad))
