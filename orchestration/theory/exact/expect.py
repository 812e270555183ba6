"""The exact average costs of a linear loop, without runs and seeds."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from orchestration.components.fmi.foreign_calls import isolated_call
from orchestration.foundation.basics.errors import UsageError, told_apart
from orchestration.foundation.basics.unit_algebra import quantity, some
from orchestration.foundation.processes.passable import passable
from orchestration.simulation.requests.request import RequestLike, request_of
from orchestration.simulation.workers.choice import single_run_execution
from orchestration.systems.expressions.syntax import Call
from orchestration.systems.system.files import files_of
from orchestration.systems.system.model import System
from orchestration.systems.system.request import errors_in_own_terms
from orchestration.theory.exact.flown import doubt
from orchestration.theory.exact.loops import Converged, Loops
from orchestration.theory.exact.objectives import ObjectiveMeans
from orchestration.theory.stability.known_loops import LOOPS, rested, warned_of_timing


@passable
@dataclass(frozen=True, kw_only=True)
class Expected:
    """Expectations of a linear loop, stationary or from its initial conditions to a horizon."""

    objectives: Mapping[str, float | None]
    """The expectation of each objective that consists of `mean(…)` and `rms(…)` of polynomials of degree two in
    signals, by name; None: there is none. `rms(x)` is the root of the expected mean of x²."""
    reasons: Mapping[str, str]
    """The reasons why there is none, by name; also of the fourth-moment radius."""
    mean_square_radius: float
    """The growth factor of second moments over a hyperperiod; from 1 on no mean of squares is finite, whatever a
    run prints."""
    fourth_moment_radius: float | None
    """Likewise of fourth moments; from 1 on no Monte-Carlo interval of a mean square means anything. None: too many to
    compute."""
    accuracy: float
    """Accuracy of the results, relative: the change by the last refinement, and what errors of the components, as large
    as in their measurement, do to the costs."""
    method: str
    """Method by which the components were identified, and by which the result was computed."""
    period: float
    """The hyperperiod of all that samples [s]."""
    horizon: float | None = None
    """Time over which the means are, from initial conditions [s]; None: stationary ones."""
    doubt: str = ""
    """The reason why runs may have other means, where deviations become too large for a linear loop in one that begins
    at rest; empty: none is seen, or there is no noise."""

    @property
    def verdict(self) -> str:
        """The expectations, or that there are none, by the growth of second moments."""
        shown, _ = told_apart(self.mean_square_radius, 1.0, digits=4)
        radius = f"mean-square radius {shown} in {quantity(self.period, 's')}"
        if self.horizon is None and self.mean_square_radius >= 1.0:
            return f"no mean of squares is finite: {radius}"
        known = [f"{name} = {self.shown(value, 4)}" for name, value in self.objectives.items() if value is not None]
        means = "stationary" if self.horizon is None else f"from 0 to {quantity(self.horizon, 's')}"
        return f"{some(known) if known else 'no objective has an exact expectation'} ({means}); {radius}"

    def shown(self, value: float, most: int) -> str:
        """A value with the digits that the accuracy vouches for, of so many at most."""
        digits = math.floor(-math.log10(self.accuracy)) if self.accuracy > 0.0 else most
        return f"{value:.{min(max(digits, 1), most)}g}"

    def __repr__(self) -> str:
        listed = ", ".join(f"{name} {'-' if v is None else self.shown(v, 6)}" for name, v in self.objectives.items())
        radius, _ = told_apart(self.mean_square_radius, 1.0)
        return f"<Expected: {listed or 'no objectives'}; mean-square radius {radius}>"


def expect(request: RequestLike, *, as_simulated: bool = False, horizon: float | None = None) -> Expected:
    """The stationary expectation of each objective that consists of means of quadratic expressions of signals.

    The system is linearised about its operating point, or its initial state. Noise of sources is white; delays, jitter
    and losses are distributed as in a run. `as_simulated` it is the expectation of a long run: noise is held for
    the period of its source, components in continuous time are stepped, means are over rows. With a `horizon` [s] means
    are from 0 to there, from the initial state of the system instead of its operating point.

    Raises `UsageError` for a system that does not rest there, or has no exact answer, naming why.
    """
    if horizon is not None and not 1e-9 <= horizon < math.inf:
        raise UsageError(f"horizon = {horizon:g} s: expected a finite time above 0")
    request = request_of(request)
    if horizon is not None and request.kind in LOOPS:
        raise UsageError("horizon: expected a system file, which has an initial state")
    request, _ = single_run_execution(request, "auto")
    with errors_in_own_terms(request):
        system = rested(request)
        files = files_of(system)
        loops = Loops(files.models, simulated=as_simulated)
        with warned_of_timing(system, files):
            return isolated_call(files.fmus.values(), expected_of, system, loops, horizon, True)


def expected_of(system: System, loops: Loops, horizon: float | None = None, flown: bool = False) -> Expected:
    """As `expect`, of a system whose FMUs are loaded in this process.

    In doubt, and of an accuracy by what errors of its components do, only if it is to be `flown`.
    """
    solution = loops.solve(system, judged=flown and horizon is None)
    linear, loop, means = solution.linear, solution.loop.result, solution.means
    converged: Converged[Any] = solution.loop
    if horizon is not None:
        converged = loops.solve_to(system, horizon, judged=flown)
        means = converged.result
    if means is None:
        why = f"the mean-square radius is {told_apart(loop.radius, 1.0)[0]}: the mean has no finite expectation"
        values: dict[str, float | None] = dict.fromkeys(system.objectives)
        reasons = {**linear.objectives.reasons, **dict.fromkeys(linear.objectives.calls, why)}
    else:
        values, reasons = _finite_values(linear.objectives, means), linear.objectives.reasons
    reasons = {name: reasons[name] for name in system.objectives if name in reasons}
    if loop.fourth_moment_radius is None:
        reasons["fourth_moment_radius"] = "too many fourth moments to compute"
    return Expected(
        objectives=values, reasons=reasons,
        mean_square_radius=loop.radius, fourth_moment_radius=loop.fourth_moment_radius,
        accuracy=converged.difference + max(linear.accuracy, converged.sensitivity), period=solution.loop.period,
        method=_method(linear.methods, converged.order, system, simulated=loops.simulated, horizon=horizon),
        horizon=horizon,
        doubt=doubt(system, linear.objectives, means, linear.start, loops.instances, horizon) if flown and means else ""
    )  # fmt: skip


def _finite_values(objectives: ObjectiveMeans, means: Mapping[Call, float]) -> dict[str, float | None]:
    """The values of objectives; None for those that overflow."""
    found = objectives.values(means)
    for name, value in found.items():
        if value is not None and not math.isfinite(value):
            found[name] = None
            objectives.reasons[name] = "overflows before the horizon"
    return found


def _method(
    methods: Mapping[str, str], order: int | None, system: System, *, simulated: bool, horizon: float | None
) -> str:
    known: dict[str, list[str]] = {}
    for name, method in methods.items():
        known.setdefault(method, []).append(name)
    parts = ["second moments of the loop about its operating point"]
    parts += [f"{', '.join(listed)} known by {method}" for method, listed in known.items()]
    if horizon is not None:
        parts.append(f"from its initial conditions to {horizon:g} s")
    if system.uses_scheduler:
        parts.append("computers and networks by their periodic timetable")
    if simulated:
        parts.append("noise held, steps and means over rows as in a run")
    if order is not None:
        parts.append(f"random times by Gauss's rule with {order} nodes between any two instants")
    rounded = [x.name for x in system.connections if any(x.quantisation.values())]
    if rounded:
        parts.append(f"quantisation of {', '.join(rounded)} as noise of a variance of q²/12")
    return "; ".join(parts)
