"""What a linear loop costs on average, exactly: no run, no seed."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from orchestration.building.inputs import files_of
from orchestration.exact.loops import Loops
from orchestration.fmi.foreign import computed
from orchestration.requests.request import Asked, asked_for
from orchestration.stability.known_loops import rested
from orchestration.system.model import System
from orchestration.system.paths import changed
from orchestration.system.request import in_its_own_words

ROUNDING, DIFFERENCES = 1e-11, 1e-7
"""of a figure: how far it is known, by how the components are"""


@dataclass(frozen=True, kw_only=True)
class Expected:
    """Expectations of a linear loop, where it has come to stay."""

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

    def __repr__(self) -> str:
        listed = ", ".join(f"{name} {'-' if v is None else f'{v:.6g}'}" for name, v in self.objectives.items())
        return f"<Expected: {listed or 'no objectives'}; mean-square radius {self.mean_square_radius:.6g}>"


def expect(asked: Asked, *, as_simulated: bool = False) -> Expected:
    """The stationary expectation of each objective that is made of means of quadratic expressions of signals.

    The system is linearised about its operating point, or where it begins. Noise of sources is white; delays, jitter
    and losses are drawn as a run draws them. `as_simulated` it is the expectation of what a run prints when it is long:
    noise is held for the period of its source, what is in continuous time is stepped, and means are over rows.

    Raises `UsageError` for a system that does not rest there, or of which there is no exact answer, naming why.
    """
    request = asked_for(asked)
    with in_its_own_words(request):
        system = rested(request)
        files = files_of(system)
        loops = Loops(files.models, simulated=as_simulated)
        return computed(files.fmus.values(), expected_of, system, loops)


def expected_of(system: System, loops: Loops) -> Expected:
    """As `expect`, of a system whose FMUs are loaded in this process."""
    found, linear = loops.solved(system), loops.linear(changed(system, system.operating_point))
    radius = found.loop.radius
    if found.means is None:
        why = f"the mean-square radius is {radius:.6g}: the mean has no finite expectation"
        values: dict[str, float | None] = dict.fromkeys(system.objectives)
        reasons = {**linear.wanted.reasons, **dict.fromkeys(linear.wanted.calls, why)}
    else:
        values, reasons = linear.wanted.values(found.means), linear.wanted.reasons
    known = max((DIFFERENCES if "differences" in by else ROUNDING for by in linear.how.values()), default=ROUNDING)
    return Expected(
        objectives=values, reasons={name: reasons[name] for name in system.objectives if name in reasons},
        mean_square_radius=radius, fourth_moment_radius=found.loop.fourth_moment_radius, accuracy=found.apart + known,
        method=_method(linear.how, found.order, system, simulated=loops.simulated), period=found.period,
    )  # fmt: skip


def _method(how: Mapping[str, str], order: int | None, system: System, *, simulated: bool) -> str:
    known: dict[str, list[str]] = {}
    for name, by in how.items():
        known.setdefault(by, []).append(name)
    said = ["second moments of the loop about its operating point"]
    said += [f"{', '.join(listed)} known by {by}" for by, listed in known.items()]
    if simulated:
        said.append("noise held, steps and means over rows as in a run")
    if order is not None:
        said.append(f"random times by Gauss's rule with {order} nodes between any two instants")
    rounded = [x.name for x in system.connections if any(x.quantisation.values())]
    if rounded:
        said.append(f"quantisation of {', '.join(rounded)} as noise of a variance of q²/12")
    return "; ".join(said)
