"""Infinite mean squares: the value of a random quantity from which on they are, and a warning for such runs."""

import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path

from orchestration.components.building.fmus import locate, native_twin, native_twins
from orchestration.components.fmi.foreign_calls import isolated_call
from orchestration.components.fmi.read_description import Model
from orchestration.foundation.basics.bisection import Range, ends_of_good
from orchestration.foundation.basics.errors import QuadcosimError, SimulatorError, UsageError, prefixed, told_apart
from orchestration.foundation.basics.terminal import inform, progress_bar
from orchestration.foundation.processes.passable import passable
from orchestration.simulation.requests.ranges import Varied
from orchestration.systems.system.files import Files
from orchestration.systems.system.model import System
from orchestration.systems.system.paths import at_operating_point, changed
from orchestration.systems.system.request import Request
from orchestration.theory.exact.examined_limit import RADIUS_TOLERANCE, Moving, by_examined
from orchestration.theory.exact.loops import Loops, linearised_as
from orchestration.theory.exact.moments import JumpLinear
from orchestration.theory.exact.objectives import has_mean_of_squares, inlined_objectives, means_of
from orchestration.theory.stability.known_loops import LOOPS, LinearLimit, rested
from orchestration.theory.stability.operating_point import hyperperiod, periods_of
from orchestration.theory.stability.sign_changes import zero_between

LIMIT_TOLERANCE = 0.01
"""Share of the tolerance of a measured limit"""
ROOT = 1e-9
"""Difference of a radius from 1 at a limit"""
SECOND_MOMENTS = Moving("second moments", "are bounded", "grow without bound")


def mean_square_limit(varied: Varied, span: Range, models: Mapping[str, Model]) -> LinearLimit:
    """The first value of a quantity, up from the system's own, at which the mean-square radius of the loop is 1.

    It is between values that can be examined, if not all can; farther apart than the tolerance, they are all it says.
    """
    try:
        system = rested(varied.request)
        by_fmu = {component.fmu: models[name] for name, component in system.components.items()}
        return _crossing(system, varied.paths, span, Loops(by_fmu))
    except (UsageError, SimulatorError) as error:
        return LinearLimit(reason=f"no mean-square limit: {error}")


def _crossing(system: System, paths: Sequence[str], span: Range, loops: Loops) -> LinearLimit:
    tried = dict[float, float]()

    def radius(value: float) -> float:
        if value not in tried:
            tried[value] = loops.radius(changed(system, dict.fromkeys(paths, value)), agree=RADIUS_TOLERANCE)
        return tried[value]

    try:
        return _root(radius, span, tried)
    except (UsageError, SimulatorError):
        can_go_on = bool(tried) or system.uses_scheduler
        known = by_examined(radius, span, SECOND_MOMENTS, lower_too=False) if can_go_on else None
        if known is None:
            raise
        if known.limit is not None and (known.accuracy or 0.0) > span.tolerance_at(known.limit):
            return LinearLimit(reason=known.reason)
        return known


def _root(radius: Callable[[float], float], span: Range, tried: Mapping[float, float]) -> LinearLimit:
    """As `mean_square_limit`; raises `UsageError` where one of the values to be `tried` cannot be examined."""

    def above(value: float) -> float:
        with prefixed(f"at {span.text(value)}: "):
            return radius(value) - 1.0

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
        reason=f"nor have they at what was tried above, up to {span.text(max(tried))}; other values above may have one "
        "again",
    )


SURE_TOLERANCE = 1e-3
"""Difference of a radius allowed from order to order: enough to know whether it is above 1"""
LONG = 10.0
"""Time from which on a remark says what would be faster [s]"""
MAX_LINEARISED = 50
"""systems that are linearised: others are examined that differ from them in random times alone"""
MAX_SAMPLES = 250
"""Samples in the hyperperiod of a system that is examined; more take long if a plant is in Python"""
MAX_FOURTH_WORK = 3e8
"""Products, in about a second, by which it is examined whether a mean has a variance"""
NO_EXPECTATION, NO_VARIANCE = "no finite expectation", "no finite variance"
"""Remarks on means of squares: second moments, or fourth ones, grow without bound"""
NOT_EXAMINED, VARIANCE = "not examined: ", "variance not examined: too many fourth moments"
"""Beginning of a remark that states why it is not known whether means are finite; remark where variances may not be"""
LONG_HYPERPERIOD = f"a hyperperiod of more than {MAX_SAMPLES} samples; quadcosim expect does, or says why not"
TOO_MANY = f"more than {MAX_LINEARISED} systems that differ in more than delays, losses and jitter"


@passable
@dataclass(frozen=True, kw_only=True)
class MeanSquares:
    """Whether means of squares have a finite expectation in a system."""

    remark: str = ""
    """Empty: they have one, and a finite variance, or nothing is random"""
    radius: float = 0.0
    """The growth factor that is 1 or more, of second or fourth moments; else 0"""


def mean_squares(request: Request, systems: Sequence[System], files: Files) -> list[MeanSquares]:
    """Examine the means of squares of these systems.

    Examined are systems with something random and an objective that is a mean of squares, unless their kind has its
    own loop: those are not linear where they run.
    """
    places: dict[str, list[int]] = {}
    for place, system in enumerate(systems) if request.kind not in LOOPS else ():
        if system.depends_on_seed and objectives_of_means(system):
            places.setdefault(replace(system, seed=0).to_toml(), []).append(place)
    chosen = {key: replace(systems[alike[0]], seed=0) for key, alike in places.items()}
    linear = {key: _linearised_as(one) for key, one in chosen.items() if _samples_in_hyperperiod(one) <= MAX_SAMPLES}
    first = {*list(dict.fromkeys(linear.values()))[:MAX_LINEARISED]}
    keys = [key for key in linear if linear[key] in first]
    reasons = {key: TOO_MANY if key in linear else LONG_HYPERPERIOD for key in chosen}
    remarks = {key: MeanSquares(remark=f"{NOT_EXAMINED}{reason}") for key, reason in reasons.items()}
    remarks |= zip(keys, _examined([chosen[key] for key in keys], files))
    found = [MeanSquares()] * len(systems)
    for key, remark in remarks.items():
        for place in places[key]:
            found[place] = remark
    return found


def _examined(systems: Sequence[System], files: Files) -> Sequence[MeanSquares]:
    try:
        systems, files = _with_twins(systems, files)
        began = time.monotonic()
        found = isolated_call(files.fmus.values(), growths_of, systems, files.models) if systems else []
    except QuadcosimError as error:
        return [MeanSquares(remark=f"{NOT_EXAMINED}{error}")] * len(systems)
    if (took := time.monotonic() - began) > LONG and any(native_twin(fmu) != fmu for fmu in files.fmus):
        inform(f"means of squares took {took:.0f} s by FMUs in Python; quadcosim build --native makes fast ones")
    return found


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


def objectives_of_squares(system: System) -> list[str]:
    """Those of them whose variance over runs is of fourth moments."""
    nodes = inlined_objectives(system.objectives)
    return [name for name in objectives_of_means(system) if has_mean_of_squares(nodes[name])]


def growths_of(systems: Sequence[System], models: Mapping[str, Model]) -> list[MeanSquares]:
    """What the growth of second and fourth moments says of systems; not examined is what is not linear about a rest.

    Those of long periods come first: what is measured over a long one holds over shorter ones.
    """
    loops, found = Loops(models, nearly=True), dict[int, MeanSquares]()
    with progress_bar("means of squares") as report:
        for place in sorted(range(len(systems)), key=lambda place: -max(periods_of(systems[place]), default=0)):
            report(len(found) / len(systems))
            try:
                found[place] = _of_loop(loops.jump_linear(systems[place], agree=SURE_TOLERANCE))
            except QuadcosimError as error:
                found[place] = MeanSquares(remark=f"{NOT_EXAMINED}{error}")
    return [found[place] for place in range(len(systems))]


def _of_loop(loop: JumpLinear) -> MeanSquares:
    if loop.radius >= 1.0:
        return MeanSquares(remark=NO_EXPECTATION, radius=loop.radius)
    fourth = loop.fourth_moment_radius if loop.fourth_moment_work <= MAX_FOURTH_WORK else None
    if fourth is None:
        return MeanSquares(remark=VARIANCE)
    return MeanSquares(remark=NO_VARIANCE, radius=fourth) if fourth >= 1.0 else MeanSquares()
