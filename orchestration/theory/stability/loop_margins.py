"""Margins of loops in the frequency domain, with their curves: of one component, or of several."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Literal

import numpy as np

from orchestration.foundation.basics.extras import explains_missing
from orchestration.foundation.basics.simulator import Floats
from orchestration.foundation.basics.unit_algebra import quantity
from orchestration.foundation.processes.passable import passable
from orchestration.systems.system.connection import component_of
from orchestration.theory.stability.in_double import of_code
from orchestration.theory.stability.linearise import clock_of, stability_of
from orchestration.theory.stability.poles import Complexes

if TYPE_CHECKING:
    from orchestration.simulation.figures.style import Figures


@passable
@dataclass(frozen=True, kw_only=True)
class GainMargin:
    """A factor on a command beyond which the loop is unstable."""

    factor: float
    """The factor: below 1 the loop has to keep more of its gain, above 1 it stands no more."""
    frequency: float
    """The frequency at which the loop gain times the factor is -1 [rad/s]; 0: the loop drifts away."""


@passable
@dataclass(frozen=True, kw_only=True)
class LoopMargins:
    """The loop of one command, cut where it leaves the component, and its margins."""

    input: str
    """The inputs that the command goes to, as COMPONENT.VARIABLE."""
    output: str
    """The command, as COMPONENT.VARIABLE."""
    gain_margin: float | None
    """The factor on the command nearest to 1 at which the loop becomes unstable; None: infinite."""
    gain_margins: tuple[GainMargin, ...]
    """The nearest such factor below 1, and the one above, in rising order; a missing one: any factor on that side."""
    phase_margin: float | None
    """The smallest distance of the phase from that of -1 where the gain is 1 [deg]; None: it is nowhere 1."""
    delay_margin: float | None
    """The further delay of the command at which the loop becomes unstable [s]; None: infinite, or not known."""
    delay_reason: str = ""
    """Why the delay margin is not known; empty: it is."""
    crossover: float | None
    """The frequency of the phase margin [rad/s]; None: the gain is nowhere 1."""
    sensitivity_peak: float
    """The largest absolute value of the sensitivity 1 / (1 + L)."""


@passable
@dataclass(frozen=True, kw_only=True)
class Bode:
    """The loops of a component about its operating point, one for each command, with the others closed."""

    dt: float
    """Time from sample to sample [s]."""
    samples: int = 1
    """Samples of the component in a period of all rates; margins are of a command at all of them."""
    stable: bool
    """Whether the closed loop is stable; margins are those of a stable loop only."""
    radius: float
    """The spectral radius of the closed loop over a period."""
    sensitivity_peak: float | None
    """The largest of the loops' peaks; None: the loop is unstable."""
    loops: tuple[LoopMargins, ...]
    """The loops with their margins; empty if the loop is unstable."""
    outputs: tuple[str, ...]
    """The commands, one for each loop, as COMPONENT.VARIABLE; also of an unstable loop."""
    frequencies: Floats = field(repr=False)
    """Frequencies up to half the sampling rate [rad/s], shape (n,)."""
    gains: Complexes = field(repr=False)
    """Loop gains L at them, which negative feedback closes, shape (loops, n)."""
    in_double: tuple[str, ...] = ()
    """The components whose float code in C is taken in double precision."""

    def __repr__(self) -> str:
        return f"<Bode: {self.verdict}>"

    @property
    def phases(self) -> Floats:
        """Phases without jumps [deg], shape (loops, n), from between -270 and 90 at the lowest frequency.

        Those of a loop whose margin would be at +180 are whole turns lower, so that it is at -180.
        """
        phases = np.degrees(np.unwrap(np.angle(self.gains), axis=-1))
        unturned: Floats = phases - 360.0 * np.ceil((phases[:, :1] - 91.0) / 360.0)
        for phase, loop in zip(unturned, self.loops):
            phase -= max(0.0, critical_phase(loop, self.frequencies, phase) + 180.0)
        return unturned

    @property
    def verdict(self) -> str:
        """The smallest margins of a loop, or that it is unstable and has none."""
        return _verdict([self], clock_of(self.dt, self.samples))

    @property
    def components(self) -> "Mapping[str, Bode]":
        """This one by the name of its component, as of several."""
        return {component_of(self.outputs[0]): self}

    @explains_missing
    def plot(self, *, style: Literal["screen", "paper", "slides"] = "screen") -> "Figures":
        """The loop gain, its phase and the sensitivity over the frequency; a notebook shows it.

        `style` sets its size and fonts. Raises `UsageError` for an unknown style.
        """
        return _plotted([self], style)


@dataclass(frozen=True, kw_only=True)
class Bodes:
    """The loops of several components about one operating point: each is cut open with all others closed."""

    components: Mapping[str, Bode]
    """The loops of each component, up to half its own sampling rate, by its name."""

    def __repr__(self) -> str:
        return f"<Bodes: {self.verdict}>"

    @property
    def stable(self) -> bool:
        """Whether the closed loop is stable: it is one, wherever it is cut open."""
        return all(each.stable for each in self.components.values())

    @property
    def sensitivity_peak(self) -> float | None:
        """The largest of the loops' peaks; None: the loop is unstable."""
        return max((loop.sensitivity_peak for loop in self.loops), default=None)

    @property
    def loops(self) -> tuple[LoopMargins, ...]:
        """The loops of all components with their margins; empty if the loop is unstable."""
        return tuple(loop for each in self.components.values() for loop in each.loops)

    @property
    def verdict(self) -> str:
        """The smallest margins, and of which loop each is, or that the loop is unstable and has none."""
        each = [f"{name} every {quantity(one.dt, 's')}" for name, one in self.components.items()]
        return _verdict([*self.components.values()], f"loops of {', '.join(each)}")

    @explains_missing
    def plot(self, *, style: Literal["screen", "paper", "slides"] = "screen") -> "Figures":
        """As that of `Bode`, with the curves of all loops; a figure for each component where they are too many."""
        return _plotted([*self.components.values()], style)


def _verdict(found: Sequence[Bode], which: str) -> str:
    """The smallest margins of all loops of some components, with their names where there are several."""

    def named(what: str, loop: LoopMargins) -> str:
        return f"{what} of {loop.output}" if len(found) > 1 else what

    first, loops = found[0], [loop for each in found for loop in each.loops]
    if not first.stable:
        return f"{stability_of(first.radius)}, {which}: an unstable loop has no margins"
    factors = sorted(((one.factor, loop) for loop in loops for one in loop.gain_margins), key=lambda one: one[0])
    nearest = [*[one for one in factors if one[0] < 1.0][-1:], *[one for one in factors if one[0] > 1.0][:1]]
    gains = [named(f"{factor:.3g}", loop) for factor, loop in nearest]
    phases = [(loop.phase_margin, loop) for loop in loops if loop.phase_margin is not None]
    delays = [(loop.delay_margin, loop) for loop in loops if loop.delay_margin is not None]
    phase, of_phase = min(phases, key=lambda one: abs(one[0]), default=(None, None))
    delay, of_delay = min(delays, key=lambda one: one[0], default=(None, None))
    margins = [
        f"gain margin{'s' * (len(gains) - 1)} {' and '.join(gains)}" if gains else "infinite gain margin",
        named(f"phase margin {phase:.3g}°", of_phase) if of_phase else "infinite phase margin",
        "delay margin not known"
        if any(loop.delay_reason for loop in loops)
        else named(f"delay margin {quantity(delay, 's')}", of_delay)
        if of_delay and delay is not None
        else "infinite delay margin",
    ]
    return f"stable, {which}: {', '.join(margins)} (small deviations{of_code(first.in_double)})"


def _plotted(found: Sequence[Bode], style: str) -> "Figures":
    from orchestration.simulation.figures.palette import MAX_LINES
    from orchestration.simulation.figures.style import Figures, style_named
    from orchestration.theory.stability.loop_figures import bode_figure

    chosen = style_named(style)
    with chosen.applied():
        if len(found) == 1 or sum(len(each.outputs) for each in found) <= MAX_LINES:
            return Figures({"bode": bode_figure(found, chosen)}, chosen)
        figures = {
            f"bode_{name}": bode_figure([one], chosen) for each in found for name, one in each.components.items()
        }
        return Figures(figures, chosen)


def critical_phase(loop: LoopMargins, frequencies: Floats, phase: Floats) -> float:
    """The phase of -1 from which a loop has its margin on the course of its phase [deg]: -180 and whole turns."""
    at, turn = loop.crossover, loop.phase_margin
    if at is None or turn is None:
        at, turn = next((one.frequency for one in loop.gain_margins), None), 0.0
    if at is None:
        return -180.0
    return 360.0 * round((float(np.interp(at, frequencies, phase)) - turn + 180.0) / 360.0) - 180.0
