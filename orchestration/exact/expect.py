"""What a linear loop costs on average, exactly: no run, no seed."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from orchestration.basics.errors import UsageError
from orchestration.building.inputs import files_of
from orchestration.exact.loops import Loops
from orchestration.exact.shared import is_shared
from orchestration.exact.wanted import Wanted
from orchestration.expressions.syntax import Call
from orchestration.fmi.foreign import computed
from orchestration.requests.request import Asked, asked_for
from orchestration.stability.known_loops import LOOPS, rested
from orchestration.system.model import System
from orchestration.system.request import in_its_own_words


@dataclass(frozen=True, kw_only=True)
class Expected:
    """Expectations of a linear loop, where it has come to stay, or from its beginning to a horizon."""

    objectives: Mapping[str, float | None]
    """By name; None: there is none."""
    reasons: Mapping[str, str]
    """Why there is none, by name."""
    mean_square_radius: float
    """By how much second moments grow in a common period; from 1 on no mean of squares is finite."""
    fourth_moment_radius: float | None
    """Likewise of fourth moments; from 1 on no Monte-Carlo interval of a mean square means anything. None: too many to
    be told."""
    accuracy: float
    """Of the figures, relative: what the finest steps of the computation still change."""
    method: str
    """How the components are known, and what was done."""
    period: float
    """The common period of all that samples [s]."""
    horizon: float | None = None
    """Over which the means are, from initial conditions [s]; None: stationary ones."""

    def __repr__(self) -> str:
        listed = ", ".join(f"{name} {'-' if v is None else f'{v:.6g}'}" for name, v in self.objectives.items())
        return f"<Expected: {listed or 'no objectives'}; mean-square radius {self.mean_square_radius:.6g}>"


def expect(asked: Asked, *, as_simulated: bool = False, horizon: float | None = None) -> Expected:
    """The stationary expectation of each objective that is made of means of quadratic expressions of signals.

    The system is linearised about its operating point, or where it begins. Noise of sources is white; delays, jitter
    and losses are drawn as a run draws them. `as_simulated` it is the expectation of what a run prints when it is long:
    noise is held for the period of its source, what is in continuous time is stepped, and means are over rows. With a
    `horizon` [s] means are from 0 to there, the system beginning as it does by itself, not at its operating point.

    Raises `UsageError` for a system that does not rest there, or of which there is no exact answer, naming why.
    """
    if horizon is not None and not 1e-9 <= horizon < math.inf:
        raise UsageError(f"horizon = {horizon:g} s: expected a finite time above 0")
    request = asked_for(asked)
    if horizon is not None and LOOPS.of(request.kind) is not None:
        raise UsageError("horizon: expected a system, of which it is known where it begins")
    with in_its_own_words(request):
        system = rested(request)
        files = files_of(system)
        loops = Loops(files.models, simulated=as_simulated)
        return computed(files.fmus.values(), expected_of, system, loops, horizon)


def expected_of(system: System, loops: Loops, horizon: float | None = None) -> Expected:
    """As `expect`, of a system whose FMUs are loaded in this process."""
    found = loops.solved(system)
    linear, radius, means, apart, order = found.linear, found.loop.radius, found.means, found.apart, found.order
    if horizon is not None:
        until = loops.until(system, horizon)
        means, apart, order = until.means, until.apart, until.order
    if means is None:
        why = f"the mean-square radius is {radius:.6g}: the mean has no finite expectation"
        values: dict[str, float | None] = dict.fromkeys(system.objectives)
        reasons = {**linear.wanted.reasons, **dict.fromkeys(linear.wanted.calls, why)}
    else:
        values, reasons = _finite(linear.wanted, means), linear.wanted.reasons
    return Expected(
        objectives=values, reasons={name: reasons[name] for name in system.objectives if name in reasons},
        mean_square_radius=radius, fourth_moment_radius=found.loop.fourth_moment_radius,
        accuracy=apart + linear.accuracy, period=found.period,
        method=_method(linear.how, order, system, simulated=loops.simulated, horizon=horizon),
        horizon=horizon,
    )  # fmt: skip


def _finite(wanted: Wanted, means: Mapping[Call, float]) -> dict[str, float | None]:
    """The objectives, but for those that have grown beyond all numbers."""
    found = wanted.values(means)
    for name, value in found.items():
        if value is not None and not math.isfinite(value):
            found[name] = None
            wanted.reasons[name] = "grows beyond all numbers before the horizon"
    return found


def _method(
    how: Mapping[str, str], order: int | None, system: System, *, simulated: bool, horizon: float | None
) -> str:
    known: dict[str, list[str]] = {}
    for name, by in how.items():
        known.setdefault(by, []).append(name)
    said = ["second moments of the loop about its operating point"]
    said += [f"{', '.join(listed)} known by {by}" for by, listed in known.items()]
    if horizon is not None:
        said.append(f"from its initial conditions to {horizon:g} s")
    if is_shared(system):
        said.append("computers and networks by their timetable, which repeats itself")
    if simulated:
        said.append("noise held, steps and means over rows as in a run")
    if order is not None:
        said.append(f"random times by Gauss's rule with {order} nodes between any two instants")
    rounded = [x.name for x in system.connections if any(x.quantisation.values())]
    if rounded:
        said.append(f"quantisation of {', '.join(rounded)} as noise of a variance of q²/12")
    return "; ".join(said)
