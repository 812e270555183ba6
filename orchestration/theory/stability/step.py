"""Steps of a sampled loop about its operating point: how it takes back what is added to a command."""

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Literal

import numpy as np

from orchestration.foundation.basics.errors import UsageError, told_apart
from orchestration.foundation.basics.extras import explains_missing
from orchestration.foundation.basics.simulator import Floats
from orchestration.foundation.basics.unit_algebra import quantity
from orchestration.simulation.requests.request import RequestLike, request_of
from orchestration.simulation.results.units import column_infos
from orchestration.systems.system.files import files_of
from orchestration.systems.system.request import system_of
from orchestration.theory.stability.frequency import expect_decided, receivers_of
from orchestration.theory.stability.in_double import of_code
from orchestration.theory.stability.linearise import Linearised, clock_of, linearise
from orchestration.theory.stability.loop_halves import ClosedLoop, closed

if TYPE_CHECKING:
    from orchestration.simulation.figures.style import Figures

LEFT = 1e-4
"""Share of a step that is left when its response ends"""
MAX_SAMPLES = 1_000_000
SETTLED = 0.02
"""Share of the final value within which a response is settled"""
LOW, HIGH = 0.1, 0.9
"""Shares of the final value between which a response rises"""
NOTHING = 1e-6
"""Share of the largest deviation, or of a step, below which what remains may be an error of identification: it is 0"""
NO_VALUE = 1e-9
"""Final value, as a share of the largest, that counts as 0"""


@dataclass(frozen=True, kw_only=True)
class StepSizes:
    """The sizes of a response to a step."""

    rise_time: float | None
    """The time from 10 to 90 % of the final value [s]; None: the final value is 0."""
    undershoot: float | None
    """Most that it first goes the wrong way, as a share of the final value [%]; None: the final value is 0."""
    overshoot: float | None
    """Excess over the final value, as a share of it [%]; None: the final value is 0."""
    settling_time: float
    """The time from which on it stays within 2 % of the final value, or of the largest where that is 0 [s]."""
    steady_state: float
    """The final value; 0: it is less than a share of the largest that may be an error."""

    @property
    def shoots(self) -> list[str]:
        """Undershoot, where there is one, and overshoot, in words; none where the final value is 0."""
        sizes = {"undershoot": self.undershoot or None, "overshoot": self.overshoot}
        return [f"{name} {size:.3g} %" for name, size in sizes.items() if size is not None]


@dataclass(frozen=True, kw_only=True)
class LoopStep(StepSizes):
    """The response of one command's loop to a step of 1 that is added to it; 1 in the end if all is taken back."""

    input: str
    """The inputs that the command goes to, as COMPONENT.VARIABLE."""
    output: str
    """The command, as COMPONENT.VARIABLE."""
    unit: str | None
    """Its unit, as its FMU declares it."""


@dataclass(frozen=True, kw_only=True)
class Step:
    """The responses of the loops of a component, one for each command, with the others closed."""

    dt: float
    """Time from sample to sample [s]."""
    samples: int = 1
    """Samples of the component in a period of all rates."""
    loops: tuple[LoopStep, ...]
    """The loops, one for each command."""
    times: Floats = field(repr=False)
    """Times of the samples [s], shape (n,)."""
    responses: Floats = field(repr=False)
    """Share of each step that the law takes back, shape (loops, n)."""
    in_double: tuple[str, ...] = ()
    """The components whose float code in C is taken in double precision."""

    def __repr__(self) -> str:
        return f"<Step: {self.verdict}>"

    @property
    def verdict(self) -> str:
        """How long the slowest loop takes, and what it takes back."""
        slowest = self.slowest
        shoots = "".join(f", {each}" for each in slowest.shoots)
        settled = f"settles in {quantity(slowest.settling_time, 's')}"
        return (
            f"a step on {slowest.output} {settled}{shoots}, {100.0 * slowest.steady_state:.4g} % taken back, "
            f"{clock_of(self.dt, self.samples)} (small deviations{of_code(self.in_double)})"
        )

    @property
    def slowest(self) -> LoopStep:
        """The loop that settles last."""
        return max(self.loops, key=lambda each: each.settling_time)

    @explains_missing
    def plot(self, *, style: Literal["screen", "paper", "slides"] = "screen") -> "Figures":
        """The responses over time; a notebook shows them.

        `style` sets sizes and fonts. Raises `UsageError` for an unknown style.
        """
        from orchestration.simulation.figures.style import Figures, style_named
        from orchestration.theory.stability.loop_figures import step_figure

        chosen = style_named(style)
        with chosen.applied():
            return Figures({"step": step_figure(self, chosen)}, chosen)


def step(request: RequestLike, component: str | None = None) -> Step:
    """The responses of a sampled component's loops to steps added to its commands, about the operating point.

    The response is L / (1 + L), with the loop gain L of `bode`: by how much the law lowers a command to which 1 is
    added. Default `component`: the only sampled one.

    Raises `UsageError` as `linearise`, and for a loop that is unstable.
    """
    loop = linearise(request, component)
    expect_decided(loop)
    if loop.radius > 1.0:
        radius, _ = told_apart(loop.radius, 1.0)
        raise UsageError(f"step: expected a stable loop; the spectral radius of this one is {radius}")
    whole, count = closed(loop), len(loop.component.outputs) // loop.samples
    each = np.tile(np.eye(count), (loop.samples, 1))  # a step of 1 on a command is on all of its samples
    responses = _responses(whole, each, float(np.abs(np.linalg.eigvals(whole.A)).max(initial=0.0)))
    times: Floats = loop.dt * np.arange(responses.shape[1], dtype=float)
    settled = np.asarray(np.linalg.solve(np.eye(len(whole.A)) - whole.A, whole.steps @ each), dtype=float)
    final = _taken_back(whole, each, settled).mean(axis=1)
    found = (_figures(loop, request, i, times, responses[i], float(final[i])) for i in range(count))
    return Step(
        dt=loop.dt, samples=loop.samples, loops=tuple(found), times=times, responses=responses,
        in_double=loop.in_double,
    )  # fmt: skip


def _taken_back(whole: ClosedLoop, each: Floats, state: Floats) -> Floats:
    """What the law takes back at the samples of a period, shape (commands, samples), by the state at its begin."""
    count = each.shape[1]
    sent = (whole.commands @ state + whole.direct @ each).reshape(-1, count, count)
    return np.asarray(-np.diagonal(sent, axis1=1, axis2=2).T)


def _responses(whole: ClosedLoop, each: Floats, radius: float) -> Floats:
    """What the law takes back at each sample, shape (commands, n), until nothing moves."""
    A, steps, samples = whole.A, whole.steps @ each, len(each) // each.shape[1]
    count = periods_until_left(radius, len(A), samples)
    state, found = np.zeros_like(steps), np.zeros((each.shape[1], count, samples))
    for k in range(count):
        found[:, k] = _taken_back(whole, each, state)
        state = A @ state + steps
    return found.reshape(len(found), -1)


def periods_until_left(radius: float, states: int, samples: int) -> int:
    """After how many periods, each of some samples, a response has ended; raises `UsageError` for too many."""
    count = MAX_SAMPLES if radius >= 1.0 else math.ceil(math.log(LEFT) / math.log(max(radius, LEFT))) + states + 1
    if count * samples >= MAX_SAMPLES:
        raise UsageError(f"step: expected a response of at most {MAX_SAMPLES} samples; this loop needs more")
    return count


def sizes_of(times: Floats, response: Floats, final: float, *, has_value: bool) -> StepSizes:
    """The sizes of a response whose final value is not 0 if it `has_value`."""
    largest = float(np.abs(response).max(initial=0.0))
    share = response / final if has_value else response
    outside = np.flatnonzero(np.abs(response - final) > SETTLED * (abs(final) if has_value else largest))
    wrong_way = max(0.0, -float(share.min()))
    low, high = (int((share >= level).argmax()) for level in (LOW, HIGH)) if has_value else (0, 0)
    return StepSizes(
        rise_time=float(times[high] - times[low]) if has_value else None,
        undershoot=None if not has_value else 0.0 if wrong_way < NOTHING else 100.0 * wrong_way,
        overshoot=max(0.0, 100.0 * (float(share.max()) - 1.0)) if has_value else None,
        settling_time=float(times[min(outside[-1] + 1, len(times) - 1)]) if len(outside) else 0.0,
        steady_state=final if has_value else 0.0,
    )


def _figures(loop: Linearised, request: RequestLike, i: int, times: Floats, response: Floats, final: float) -> LoopStep:
    output, system = f"{loop.name}.{loop.component.outputs[i].removesuffix('[0]')}", system_of(request_of(request))
    has_value = abs(final) > NO_VALUE * max(float(np.abs(response).max(initial=0.0)), 1.0)
    return LoopStep(
        input=receivers_of(request, output),
        output=output,
        unit=column_infos(system, files_of(system).models_of(system), [output])[output].unit,
        **vars(sizes_of(times, response, final, has_value=has_value)),
    )
