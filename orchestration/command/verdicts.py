"""The answers of commands, a sentence each: what was found, with units, and under which clock.

A sentence is the first line that a command prints, and `verdict` of its document.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING

from orchestration.foundation.basics.number_text import quantity

if TYPE_CHECKING:
    from orchestration.components.checks.doctor.report import DoctorReport
    from orchestration.experiments.comparison.cells import CellSummary
    from orchestration.experiments.comparison.design import Comparison
    from orchestration.experiments.comparison.outcome import Outcome
    from orchestration.experiments.limits.limit_result import Limit
    from orchestration.experiments.tuning.tune import Tuned
    from orchestration.quadrotor.flight.margin import Margin
    from orchestration.simulation.runs.result import Result
    from orchestration.simulation.runs.scheduling import Scheduled
    from orchestration.theory.certificates.certificate import Checked
    from orchestration.theory.certificates.margin import Certified
    from orchestration.theory.certificates.region import Region
    from orchestration.theory.exact.expect import Expected
    from orchestration.theory.stability.frequency import Bode
    from orchestration.theory.stability.linearise import Linearised
    from orchestration.theory.stability.root_locus import RootLocus
    from orchestration.theory.stability.step_response import Step

DIGITS_OF_RUN = 3
MAX_NAMED = 3
"""Names, or values, in a sentence; more are counted"""
DIGITS_OF_LIMIT = 6
NEAR_ONE = 1e-7
"""Distance of a spectral radius from 1 that rounding may explain"""


def of_run(result: Result) -> str:
    """How a run ended, by the objective that its criterion judges, and its clock."""
    from orchestration.systems.system.description import describe_clock

    return f"{_outcome(result)}, {describe_clock(result.system)}"


def _outcome(result: Result) -> str:
    from orchestration.simulation.results.objectives import judged_objective, unmet

    metrics, units = result.metrics, result.units
    if result.divergence is not None:
        return f"diverged: {result.divergence}"
    outcome, until = metrics["outcome"], f"at {quantity(result.end, 's')}"
    if result.termination is not None:
        return f"terminated {until}: {result.termination}"
    if (missed := unmet(result.system, metrics, units)) is not None:
        return f"{outcome}: {missed}"
    name = judged_objective(result.system)
    left = None if name is None else metrics.get(name)
    text = quantity(left, units.get(name or ""), DIGITS_OF_RUN) if isinstance(left, float) else "no value"
    settled = metrics.get("settling_time")
    if outcome == "settled" and isinstance(settled, float):
        return f"settled in {quantity(settled, 's', DIGITS_OF_RUN)}, {text} left"
    judged = "" if name is None else f": {name} = {text}"
    return f"{outcome or f'ended {until}'}{judged}"


def of_limit(limit: Limit) -> str:
    """The last good value, the first that is not and how it failed, and how finely that was searched."""

    def shown(value: float) -> str:
        return quantity(value, limit.unit, DIGITS_OF_LIMIT)

    tolerance = quantity(limit.tolerance, limit.unit, DIGITS_OF_LIMIT, limit.scan)
    resolution = f"scan {shown(limit.scan)}, tolerance {tolerance}"
    seeds = f", all of {limit.seeds} seeds" if limit.seeds > 1 else ""
    good = limit.large_signal_limit
    failed = next((one for one in limit.tried if not one.is_good and (good is None or one.value > good)), None)
    if failed is None:
        return f"{limit.of} good throughout the scan, up to {shown(limit.tried[-1].value)}{seeds} ({resolution})"
    how = failed.outcome if failed.unmet is None else f"{failed.outcome}, {failed.unmet}"
    fails = f"diverges at {shown(failed.value)}" if how == "diverged" else f"not at {shown(failed.value)}: {how}"
    if good is None:
        return f"{limit.of} not good even at {shown(failed.value)}, where the scan begins: {how} ({resolution})"
    again = f"; good again at {_some(map(shown, limit.flies_above))}" if limit.flies_above else ""
    return f"{limit.of} good up to {shown(good)}{seeds}; {fails}{again} ({resolution})"


def of_counts(outcomes: Mapping[str | None, int], total: int) -> str:
    """How the runs of a study ended, the most frequent outcome first; those without an outcome are not counted here."""
    counts = sorted(((count, name) for name, count in outcomes.items() if name), reverse=True)
    ended = ", ".join(f"{count} {name}" for count, name in counts)
    return f"{ended or 'no outcome'} of {total} runs"


def of_comparison(comparison: Comparison, outcome: Outcome) -> str:
    """Up to which value of the axis half of the runs survive, by controller, where first it was measured."""
    half = [one for one in outcome.limits if (one.fate, one.share) == ("survive", "half")]
    unit = "s" if comparison.is_in_seconds else None
    if not half:
        counts = [f"{cell.controller} {cell.survives.count} of {cell.count}" for cell in outcome.cells]
        return f"no limits, as cells are missing; survive: {_some(counts)}" if counts else "no cell has runs"
    places = dict.fromkeys((one.vehicle, one.condition) for one in half)
    first = next(iter(places))
    reached = [
        f"{one.controller} to {quantity(one.value, unit)}" for one in half if (one.vehicle, one.condition) == first
    ]
    others = f" ({len(places) - 1} more below)" if len(places) > 1 else ""
    where = f"{first[0]}, {first[1]}"
    return f"half of the runs survive over {comparison.axis.name}: {_some(reached)}; {where}{others}"


def of_cell(cell: CellSummary) -> str:
    """How many runs of a cell survive and settle."""
    return f"{cell.survives.count} of {cell.count} runs survive, {cell.settles.count} settle"


def of_tuning(tuned: Tuned) -> str:
    """The lowest cost for each period."""
    costs = [f"{quantity(period, 's')} cost {one.cost:.4g}, {one.judgement}" for period, one in tuned.best.items()]
    return f"best of {len(tuned.searches)} searches: {_some(costs, '; ')}"


def of_margin(found: Certified) -> str:
    """How far a quantity may vary with the loop proved stable, and what is known to break it."""

    def shown(value: float) -> str:
        return f"{value:g} in a row" if found.of.endswith("loss") else quantity(value, "s")

    if found.breaking == 0.0:
        return f"unstable even without variation of {found.of}"
    proved = "no proof found" if found.certified is None else f"every sequence up to {shown(found.certified)} is stable"
    broken = f"none found up to {shown(found.largest)} that breaks the loop"
    if found.breaking is not None:
        broken = f"one of {shown(found.breaking)} breaks the loop"
    return f"{found.of}: {proved}, {broken} (small deviations)"


def of_hover_margin(found: Margin) -> str:
    """The delays of the command about hover that leave the loop stable."""
    if found.delay_limit is None:
        constant = "no constant delay of the range is its limit"
    else:
        constant = f"stable up to a constant delay of {quantity(found.delay_limit, 's')}"
    varying = f"and with any sequence of delays up to {quantity(found.delay + found.certain_jitter, 's')}"
    return f"{constant}, {varying}, sampled every {quantity(found.period, 's')} (small deviations from hover)"


def of_region(found: Region) -> str:
    """How many pairs of values are proved stable, and how many break the loop."""
    return f"{len(found.certified)} pairs are proved stable, {len(found.breaking)} break the loop (small deviations)"


def of_check(found: Checked) -> str:
    """What a certificate proves, and about what."""
    whose = " and ".join(found.of) + " of this system" if found.of else "the matrices in the file"
    return f"the proof holds: no sequence makes the {found.states} numbers of the loop grow ({whose})"


def of_expected(found: Expected) -> str:
    """The expectations, or that there are none, by the growth of second moments."""
    radius = f"mean-square radius {found.mean_square_radius:.4g} in {quantity(found.period, 's')}"
    if found.horizon is None and found.mean_square_radius >= 1.0:
        return f"no mean of squares is finite: {radius}"
    known = [f"{name} = {value:.4g}" for name, value in found.objectives.items() if value is not None]
    means = "stationary" if found.horizon is None else f"from 0 to {quantity(found.horizon, 's')}"
    return f"{_some(known) if known else 'no objective has an exact expectation'} ({means}); {radius}"


def of_linearised(loop: Linearised) -> str:
    """Whether the linear loop is stable, and its sizes."""
    sizes = f"{loop.name} with {_states(len(loop.component.A))}, the rest with {_states(len(loop.rest.A))}"
    return f"{_stable(loop.radius)}, sampled every {quantity(loop.rest.dt, 's')}: {sizes}"


def of_bode(found: Bode) -> str:
    """The smallest margins of a loop, or that it is unstable and has none."""
    clock = f"sampled every {quantity(found.dt, 's')}"
    if not found.stable:
        return f"{_stable(found.radius)}, {clock}: an unstable loop has no margins"
    gains = [loop.gain_margin for loop in found.loops if loop.gain_margin is not None]
    phases = [loop.phase_margin for loop in found.loops if loop.phase_margin is not None]
    delays = [loop.delay_margin for loop in found.loops if loop.delay_margin is not None]
    margins = [
        f"gain margin {min(gains, key=lambda one: abs(math.log(one))):.3g}" if gains else "infinite gain margin",
        f"phase margin {min(phases, key=abs):.3g}°" if phases else "infinite phase margin",
        f"delay margin {quantity(min(delays), 's')}" if delays else "infinite delay margin",
    ]
    return f"stable, {clock}: {', '.join(margins)} (small deviations)"


def of_step(found: Step) -> str:
    """How long the slowest loop takes, and what it takes back."""
    slowest = found.slowest
    over = "" if slowest.overshoot is None else f", overshoot {slowest.overshoot:.3g} %"
    settled = f"settles in {quantity(slowest.settling_time, 's')}"
    return (
        f"a step on {slowest.output} {settled}{over}, {100.0 * slowest.steady_state:.4g} % taken back, "
        f"sampled every {quantity(found.dt, 's')} (small deviations)"
    )


def of_locus(found: RootLocus) -> str:
    """Where poles leave the unit circle and return, or that they do not."""

    def shown(value: float) -> str:
        return quantity(value, found.unit, DIGITS_OF_LIMIT)

    first, last = shown(found.values[0]), shown(found.values[-1])
    begins = "inside" if found.radius[0] < 1.0 else "not all inside"
    if not found.crossings:
        radii = f"spectral radius {found.radius.min():.4g} to {found.radius.max():.4g}"
        return f"{found.of}: poles {begins} the unit circle from {first} to {last}, {radii} (small deviations)"
    ways = [
        f"{'leave' if one.leaves else 'return'} at {shown(one.value)}, {one.frequency:.4g} rad/s"
        for one in found.crossings
    ]
    return f"{found.of}: poles {begins} the unit circle at {first}, {_some(ways, '; ')} (small deviations)"


def of_schedule(found: Scheduled) -> str:
    """Which deadlines are missed, or how near the worst response comes to one, and what is busiest."""
    each = {**found.tasks, **found.messages}
    missed = {name: one.missed for name, one in each.items() if one.missed}
    due = [name for name, one in each.items() if one.deadline is not None and one.missed is not None]
    busiest = max(found.busy, key=lambda name: found.busy[name], default=None)
    busy = "" if busiest is None else f"; {busiest} busy {100.0 * found.busy[busiest]:.3g} %"
    until = f"in {quantity(found.until, 's')}"
    if missed:
        worst = [f"{name} {100.0 * share:.3g} %" for name, share in sorted(missed.items(), key=lambda item: -item[1])]
        return f"deadlines missed {until}: {_some(worst)}{busy}"
    if not due:
        return f"no deadline to meet {until}{busy}"
    margins = {
        name: (one.response.max / one.deadline, one.response.max, one.deadline)
        for name, one in each.items()
        if one.response is not None and one.deadline
    }
    name = max(margins, key=lambda one: margins[one][0])
    _, response, deadline = margins[name]
    return f"all deadlines met {until}, {name} nearest: {quantity(response, 's')} of {quantity(deadline, 's')}{busy}"


def of_agreements(far: Sequence[str], count: int, tolerance: float) -> str:
    """Whether other masters compute the same."""
    if far:
        return f"{len(far)} of {count} tools differ by more than {tolerance:g}: {_some(far)}"
    tools = "1 tool agrees" if count == 1 else f"{count} tools agree"
    return f"{tools} with this project's master, within {tolerance:g}"


def of_doctor(report: DoctorReport) -> str:
    """How many FMUs load on this machine with all that they require."""
    count = len(report.verdicts)
    good = sum(each.good for each in report.verdicts)
    return (
        f"{good} of {count} FMU{'' if count == 1 else 's'} load{'s' if count == 1 else ''} here, with nothing missing"
    )


def _stable(radius: float) -> str:
    if math.isclose(radius, 1.0, abs_tol=NEAR_ONE):
        return f"not decidably stable: spectral radius {radius:.9g}"
    return f"{'stable' if radius < 1.0 else 'unstable'}: spectral radius {radius:.4g}"


def _states(count: int) -> str:
    return f"{count} state{'' if count == 1 else 's'}"


def _some(texts: Iterable[str], separator: str = ", ") -> str:
    known = list(texts)
    more = f" and {len(known) - MAX_NAMED} more" if len(known) > MAX_NAMED else ""
    return separator.join(known[:MAX_NAMED]) + more
