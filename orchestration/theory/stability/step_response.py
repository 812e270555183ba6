"""Steps of a sampled loop about its operating point: how it takes back what is added to a command."""

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Literal

import numpy as np

from orchestration.foundation.basics.errors import UsageError
from orchestration.foundation.basics.extras import explains_missing
from orchestration.foundation.basics.number_text import quantity
from orchestration.foundation.basics.simulator import Floats
from orchestration.simulation.requests.request import RequestLike
from orchestration.theory.stability.frequency import closed_loop, expect_decided, receivers_of
from orchestration.theory.stability.linearise import Linearised, linearise

if TYPE_CHECKING:
    from orchestration.simulation.figures.gallery import Figures

LEFT = 1e-4
"""Share of a step that is left when its response ends"""
MAX_SAMPLES = 100_000
SETTLED = 0.02
"""Share of the final value within which a response is settled"""
LOW, HIGH = 0.1, 0.9
"""Shares of the final value between which a response rises"""
NO_VALUE = 1e-9
"""Final value, as a share of the largest, that counts as 0"""


@dataclass(frozen=True, kw_only=True)
class LoopStep:
    """The response of one command's loop to a step of 1 that is added to the command."""

    input: str
    """The inputs that the command goes to, as COMPONENT.VARIABLE."""
    output: str
    """The command, as COMPONENT.VARIABLE."""
    rise_time: float | None
    """The time from 10 to 90 % of the final value [s]; None: the final value is 0."""
    overshoot: float | None
    """Excess over the final value, as a share of it [%]; None: the final value is 0."""
    settling_time: float
    """The time from which on it stays within 2 % of the final value, or of the largest where that is 0 [s]."""
    steady_state: float
    """The final value: 1 if the loop takes back all of it."""


@dataclass(frozen=True, kw_only=True)
class Step:
    """The responses of the loops of a component, one for each command, with the others closed."""

    dt: float
    """Time from sample to sample [s]."""
    loops: tuple[LoopStep, ...]
    """The loops, one for each command."""
    times: Floats = field(repr=False)
    """Times of the samples [s], shape (n,)."""
    responses: Floats = field(repr=False)
    """Share of each step that the law takes back, shape (loops, n)."""

    @property
    def verdict(self) -> str:
        """How long the slowest loop takes, and what it takes back."""
        slowest = self.slowest
        over = "" if slowest.overshoot is None else f", overshoot {slowest.overshoot:.3g} %"
        settled = f"settles in {quantity(slowest.settling_time, 's')}"
        return (
            f"a step on {slowest.output} {settled}{over}, {100.0 * slowest.steady_state:.4g} % taken back, "
            f"sampled every {quantity(self.dt, 's')} (small deviations)"
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
        from orchestration.simulation.figures.gallery import Figures
        from orchestration.simulation.figures.style import style_named
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
        raise UsageError(f"step: expected a stable loop; the spectral radius of this one is {loop.radius:.6g}")
    A = closed_loop(loop)
    commands = np.hstack([loop.component.D @ loop.rest.C, loop.component.C])
    steps = np.vstack([loop.rest.B, np.zeros((len(loop.component.A), loop.rest.B.shape[1]))])
    responses = _responses(A, steps, commands, float(np.abs(np.linalg.eigvals(A)).max(initial=0.0)))
    times: Floats = loop.rest.dt * np.arange(responses.shape[1], dtype=float)
    final = -np.diag(commands @ np.linalg.solve(np.eye(len(A)) - A, steps))
    found = (_figures(loop, request, i, times, responses[i], float(final[i])) for i in range(len(commands)))
    return Step(dt=loop.rest.dt, loops=tuple(found), times=times, responses=responses)


def _responses(A: Floats, steps: Floats, commands: Floats, radius: float) -> Floats:
    """What the law takes back at each sample, shape (commands, n), until nothing moves."""
    count = MAX_SAMPLES if radius >= 1.0 else math.ceil(math.log(LEFT) / math.log(max(radius, LEFT))) + len(A) + 1
    if count >= MAX_SAMPLES:
        raise UsageError(f"step: expected a response of at most {MAX_SAMPLES} samples; this loop needs more")
    state, found = np.zeros_like(steps), np.zeros((len(commands), count))
    for k in range(count):
        found[:, k] = -np.diag(commands @ state)
        state = A @ state + steps
    return found


def _figures(loop: Linearised, request: RequestLike, i: int, times: Floats, response: Floats, final: float) -> LoopStep:
    output = f"{loop.name}.{loop.component.outputs[i]}"
    largest = float(np.abs(response).max(initial=0.0))
    has_value = abs(final) > NO_VALUE * max(largest, 1.0)
    share = response / final if has_value else response
    outside = np.flatnonzero(np.abs(response - final) > SETTLED * (abs(final) if has_value else largest))
    low, high = (int((share >= level).argmax()) for level in (LOW, HIGH)) if has_value else (0, 0)
    return LoopStep(
        input=receivers_of(request, output),
        output=output,
        rise_time=float(times[high] - times[low]) if has_value else None,
        overshoot=max(0.0, 100.0 * (float(share.max()) - 1.0)) if has_value else None,
        settling_time=float(times[min(outside[-1] + 1, len(times) - 1)]) if len(outside) else 0.0,
        steady_state=final if has_value else 0.0,
    )
