"""Infinite mean squares: the value of a random quantity from which on they are, and a warning for such runs."""

import time
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path

from orchestration.components.building.fmus import locate, native_twin, native_twins
from orchestration.components.fmi.foreign_calls import isolated_call
from orchestration.components.fmi.read_description import Model
from orchestration.foundation.basics.bisection import Range, ends_of_good
from orchestration.foundation.basics.errors import QuadcosimError, SimulatorError, UsageError, prefixed, told_apart
from orchestration.foundation.basics.terminal import inform, progress_bar
from orchestration.simulation.requests.ranges import Varied
from orchestration.systems.system.files import Files
from orchestration.systems.system.model import System
from orchestration.systems.system.paths import at_operating_point, changed
from orchestration.systems.system.request import Request
from orchestration.theory.exact.loops import Loops, linearised_as
from orchestration.theory.exact.objectives import inlined_objectives, means_of
from orchestration.theory.stability.known_loops import LOOPS, LinearLimit, rested
from orchestration.theory.stability.operating_point import hyperperiod, periods_of
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
    tried = dict[float, float]()

    def above(value: float) -> float:
        if value not in tried:
            with prefixed(f"at {span.text(value)}: "):
                tried[value] = loops.radius(changed(system, dict.fromkeys(paths, value)), agree=RADIUS_TOLERANCE) - 1.0
        return tried[value]

    values = span.values()
    width = LIMIT_TOLERANCE * span.tolerance
    bracket = ends_of_good(lambda value: above(value) >= 0.0, values, span.own, width, geometric=span.geometric).upper
    if bracket is None:
        return LinearLimit(reason=f"second moments are bounded up to {span.text(values[-1])}, where the scan ends")
    if bracket.good is None:
        return LinearLimit(reason=f"second moments grow without bound at {span.text(values[0])}, where the scan begins")
    good, bad = ((value, above(value)) for value in (bracket.good, bracket.bad))
    low, high = zero_between(above, lambda value: value, good, bad, ROOT)
    return LinearLimit(
        limit=0.5 * (low + high),
        reason=f"nor at what was tried above, up to {span.text(max(tried))}; other values above may have one again",
    )


SURE_TOLERANCE = 1e-3
"""Difference of a radius allowed from order to order: enough to know whether it is above 1"""
LONG = 10.0
"""Time from which on a remark says what would be faster [s]"""
MAX_LINEARISED = 50
"""systems that are linearised: others are examined that differ from them in random times alone"""
MAX_SAMPLES = 250
"""Samples in the hyperperiod of a system that is examined; more take long if a plant is in Python"""


@dataclass(frozen=True, kw_only=True)
class MeanSquares:
    """Whether means of squares have a finite expectation in some systems."""

    radii: Sequence[float | None]
    """Mean-square radii by system; None: none is examined, or none is known"""
    left_out: int
    """number of systems that were too many, or have too long a hyperperiod, to be examined"""

    @property
    def infinite(self) -> list[int]:
        """The places of systems where they have none."""
        return [place for place, radius in enumerate(self.radii) if radius is not None and radius >= 1.0]


def mean_squares(request: Request, systems: Sequence[System], files: Files) -> MeanSquares:
    """Examine the means of squares of these systems.

    Examined are systems with something random and an objective that is a mean of squares, unless their kind has its
    own loop: those are not linear where they run.
    """
    places: dict[str, list[int]] = {}
    for place, system in enumerate(systems) if request.kind not in LOOPS else ():
        if system.depends_on_seed and objectives_of_means(system):
            places.setdefault(replace(system, seed=0).to_toml(), []).append(place)
    chosen = {key: replace(systems[alike[0]], seed=0) for key, alike in places.items()}
    samples = {key: _samples_in_hyperperiod(system) for key, system in chosen.items()}
    linear = {key: _linearised_as(chosen[key]) for key, number in samples.items() if number <= MAX_SAMPLES}
    first = {*list(dict.fromkeys(linear.values()))[:MAX_LINEARISED]}
    keys = [key for key in linear if linear[key] in first]
    radii: list[float | None] = [None] * len(systems)
    with suppress(QuadcosimError):
        examined, files = _with_twins([chosen[key] for key in keys], files)
        began = time.monotonic()
        found = isolated_call(files.fmus.values(), radii_of, examined, files.models) if keys else []
        if (took := time.monotonic() - began) > LONG and any(native_twin(fmu) != fmu for fmu in files.fmus):
            inform(f"means of squares took {took:.0f} s by FMUs in Python; quadcosim build --native makes fast ones")
        for key, radius in zip(keys, found):
            for place in places[key]:
                radii[place] = radius
    if long := chosen.keys() - linear.keys():
        where = f" at {sum(len(places[key]) for key in long)} of {len(systems)} points" if len(systems) > 1 else ""
        inform(
            f"means of squares not examined{where}: a hyperperiod of {max(samples[key] for key in long)} samples; "
            "quadcosim expect does, or says why not"
        )
    return MeanSquares(radii=radii, left_out=sum(len(places[key]) for key in chosen.keys() - {*keys}))


def _samples_in_hyperperiod(system: System) -> int:
    """The number of samples of all components until their instants come again."""
    periods = periods_of(system)
    return int(sum(hyperperiod(periods) / period for period in periods))


def _with_twins(systems: Sequence[System], files: Files) -> tuple[Sequence[System], Files]:
    """Systems and their files with native twins, if all are there: none is built for a warning."""
    twins = [native_twin(fmu) for fmu in files.fmus]
    if all(Path(twin).is_file() for twin in twins):
        with suppress(QuadcosimError):  # one is out of date, and cannot be built
            return [native_twins(system) for system in systems], replace(files, fmus={x: locate(x) for x in twins})
    return systems, files


def _linearised_as(system: System) -> str:
    """What its linearisation depends on; empty for one that has none at its operating point."""
    try:
        return linearised_as(at_operating_point(system))
    except UsageError:
        return ""


def infinite_means_in_words(metrics: Iterable[str], where: str, radius: float) -> str:
    """A warning about averages of these objectives over runs, in one line; `where` as " at 1 of 2 points"."""
    return (
        f"{', '.join(metrics)}: without a finite expectation{where}, so an average over runs means nothing; "
        f"the mean-square radius is {told_apart(radius, 1.0)[0]} (quadcosim expect)"
    )


def objectives_of_means(system: System) -> list[str]:
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
    """The mean-square radii of systems; None for one that is not linear about a rest, or too large.

    Those of long periods come first: what is measured over a long one holds over shorter ones.
    """
    loops, found = Loops(models, nearly=True), dict[int, float | None]()
    with progress_bar("means of squares") as report:
        for place in sorted(range(len(systems)), key=lambda place: -max(periods_of(systems[place]), default=0)):
            report(len(found) / len(systems))
            try:
                found[place] = loops.radius(systems[place], agree=SURE_TOLERANCE)
            except QuadcosimError:
                found[place] = None
    return [found[place] for place in range(len(systems))]
