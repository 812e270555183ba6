"""Infinite mean squares: the value of a random quantity from which on they are, and a warning for such runs."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cache

from orchestration.components.fmi.foreign_calls import isolated_call
from orchestration.components.fmi.read_description import Model
from orchestration.foundation.basics.bisection import Range, ends_of_good
from orchestration.foundation.basics.errors import QuadcosimError, SimulatorError, UsageError
from orchestration.foundation.basics.terminal import progress_bar
from orchestration.simulation.requests.ranges import Varied
from orchestration.systems.system.files import Files
from orchestration.systems.system.model import System
from orchestration.systems.system.paths import changed
from orchestration.systems.system.request import Request
from orchestration.theory.exact.loops import Loops
from orchestration.theory.exact.objectives import inlined_objectives, means_of
from orchestration.theory.stability.known_loops import LOOPS, LinearLimit, rested
from orchestration.theory.stability.sign_changes import zero_between

LIMIT_TOLERANCE = 0.01
"""Share of the tolerance of a measured limit"""
RADIUS_TOLERANCE, ROOT = 1e-6, 1e-9
"""Difference of a radius allowed from order to order, and from 1 at a limit"""


def mean_square_limit(varied: Varied, span: Range, models: Mapping[str, Model]) -> LinearLimit:
    """The first value of a quantity, up from the system's own, at which the mean-square radius of the loop is 1."""
    try:
        system = rested(varied.request)
        by_fmu = {component.fmu: models[name] for name, component in system.components.items()}
        return _crossing(system, varied.paths, span, Loops(by_fmu))
    except (UsageError, SimulatorError) as error:
        return LinearLimit(reason=f"no mean-square limit: {error}")


def _crossing(system: System, paths: Sequence[str], span: Range, loops: Loops) -> LinearLimit:
    @cache
    def above(value: float) -> float:
        return loops.radius(changed(system, dict.fromkeys(paths, value)), agree=RADIUS_TOLERANCE) - 1.0

    values = span.values()
    width = LIMIT_TOLERANCE * span.tolerance
    bracket = ends_of_good(lambda value: above(value) >= 0.0, values, span.own, width, geometric=span.geometric).upper
    if bracket is None:
        return LinearLimit(reason=f"second moments are bounded up to {span.text(values[-1])}, where the scan ends")
    if bracket.good is None:
        return LinearLimit(reason=f"second moments grow without bound at {span.text(values[0])}, where the scan begins")
    good, bad = ((value, above(value)) for value in (bracket.good, bracket.bad))
    low, high = zero_between(above, lambda value: value, good, bad, ROOT)
    return LinearLimit(limit=0.5 * (low + high))


SURE_TOLERANCE = 1e-3
"""Difference of a radius allowed from order to order: enough to know whether it is above 1"""
MAX_SYSTEMS = 50
"""systems that are examined"""


def infinite_means_warning(request: Request, systems: Sequence[System], files: Files) -> str | None:
    """A warning about averages over runs of these systems, in one line; None: none is due, or the radius is unknown.

    Examined are systems with something random and an objective that is a mean of squares, unless their kind has its
    own loop: those are not linear where they run.
    """
    if request.kind in LOOPS:
        return None
    chosen: dict[str, System] = {}
    for system in systems:
        if len(chosen) < MAX_SYSTEMS and system.depends_on_seed and _averages(system):
            once = replace(system, seed=0)
            chosen.setdefault(once.to_toml(), once)
    if not chosen:
        return None
    try:
        radii = isolated_call(files.fmus.values(), radii_of, [*chosen.values()], files.models)
    except QuadcosimError:
        return None
    above = [radius for radius in radii if radius is not None and radius >= 1.0]
    if not above:
        return None
    where = "" if len(radii) == 1 else f" at {len(above)} of {len(radii)} points"
    averages = ", ".join(_averages(systems[0]))
    return (
        f"{averages}: without a finite expectation{where}, so an average over runs means nothing; "
        f"the mean-square radius is {max(above):.6g} (quadcosim expect)"
    )


def _averages(system: System) -> list[str]:
    """The objectives that consist of means."""
    found = []
    for name, node in inlined_objectives(system.objectives).items():
        try:
            means_of(node)
        except UsageError:
            continue
        found.append(name)
    return found


def radii_of(systems: Sequence[System], models: Mapping[str, Model]) -> list[float | None]:
    """The mean-square radii of systems; None for one that is not linear about a rest, or too large."""
    loops, found = Loops(models), list[float | None]()
    with progress_bar("means of squares") as report:
        for i, system in enumerate(systems):
            report(i / len(systems))
            try:
                found.append(loops.radius(system, agree=SURE_TOLERANCE))
            except QuadcosimError:
                found.append(None)
    return found
