"""Loops in the frequency domain: each command's loop, the others closed, with its margins as a sampled loop."""

import math
from contextlib import closing
from dataclasses import dataclass, field, replace
from functools import cache
from typing import TYPE_CHECKING, Literal

import numpy as np

from orchestration.components.fmi.reuse import Instances
from orchestration.foundation.basics.errors import UsageError
from orchestration.foundation.basics.extras import explains_missing
from orchestration.foundation.basics.simulator import Floats
from orchestration.foundation.basics.terminal import progress_bar, warn
from orchestration.foundation.basics.unit_algebra import quantity
from orchestration.foundation.processes.passable import passable
from orchestration.simulation.requests.request import RequestLike, request_of
from orchestration.systems.system.distribution import lowest
from orchestration.systems.system.files import files_of
from orchestration.systems.system.model import System
from orchestration.systems.system.request import Request, errors_in_own_terms, system_of
from orchestration.theory.stability.delay_margin import Late, delay_margin, jumps_of
from orchestration.theory.stability.in_double import of_code
from orchestration.theory.stability.known_loops import rested
from orchestration.theory.stability.lifted_margins import gain_margins, lifted_gains, phase_margin
from orchestration.theory.stability.linearise import (
    NEAR_ONE,
    Linearised,
    clock_of,
    cut_open,
    expect_sampled,
    in_isolation,
    rest_of_loop,
    sampled_component,
    stability_of,
)
from orchestration.theory.stability.loop_at_rest import whole_at_rest
from orchestration.theory.stability.loop_halves import closed, radius
from orchestration.theory.stability.poles import Complexes
from orchestration.theory.stability.state_space import StateSpace

if TYPE_CHECKING:
    from orchestration.simulation.figures.style import Figures

LOWEST = 1e-5
"""Lowest frequency, as a share of the highest"""
SLOWER = 0.03
"""Lowest frequency, as a share of the slowest rate of the closed loop: below are the integrators alone"""
FREQUENCIES = 1500
BESIDE_A_POLE = np.linspace(-4.0, 4.0, 17)
"""Further frequencies about that of a pole, in units of its damping"""
BESIDE_A_TURN = 1e-4
"""Least distance of a frequency from whole turns in a period of several samples"""


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
        clock = clock_of(self.dt, self.samples)
        if not self.stable:
            return f"{stability_of(self.radius)}, {clock}: an unstable loop has no margins"
        factors = [one.factor for loop in self.loops for one in loop.gain_margins]
        below, above = [x for x in factors if x < 1.0], [x for x in factors if x > 1.0]
        gains = [f"{one:.3g}" for one in (max(below, default=None), min(above, default=None)) if one is not None]
        phases = [loop.phase_margin for loop in self.loops if loop.phase_margin is not None]
        delays = [loop.delay_margin for loop in self.loops if loop.delay_margin is not None]
        margins = [
            f"gain margin{'s' * (len(gains) - 1)} {' and '.join(gains)}" if gains else "infinite gain margin",
            f"phase margin {min(phases, key=abs):.3g}°" if phases else "infinite phase margin",
            "delay margin not known"
            if any(loop.delay_reason for loop in self.loops)
            else f"delay margin {quantity(min(delays), 's')}"
            if delays
            else "infinite delay margin",
        ]
        return f"stable, {clock}: {', '.join(margins)} (small deviations{of_code(self.in_double)})"

    @explains_missing
    def plot(self, *, style: Literal["screen", "paper", "slides"] = "screen") -> "Figures":
        """The loop gain, its phase and the sensitivity over the frequency; a notebook shows it.

        `style` sets its size and fonts. Raises `UsageError` for an unknown style.
        """
        from orchestration.simulation.figures.style import Figures, style_named
        from orchestration.theory.stability.loop_figures import bode_figure

        chosen = style_named(style)
        with chosen.applied():
            return Figures({"bode": bode_figure(self, chosen)}, chosen)


def critical_phase(loop: LoopMargins, frequencies: Floats, phase: Floats) -> float:
    """The phase of -1 from which a loop has its margin on the course of its phase [deg]: -180 and whole turns."""
    at, turn = loop.crossover, loop.phase_margin
    if at is None or turn is None:
        at, turn = next((one.frequency for one in loop.gain_margins), None), 0.0
    if at is None:
        return -180.0
    return 360.0 * round((float(np.interp(at, frequencies, phase)) - turn + 180.0) / 360.0) - 180.0


def bode(request: RequestLike, component: str | None = None) -> Bode:
    """The loop gains of a sampled component with all holds and delays, about the operating point, and their margins.

    As `linearise`, of which it is the frequency response: default `component` is the only sampled one. Each loop is cut
    at one command, with the others closed. A delay margin is exact also for parts of a period: the loop is linearised
    with it.

    Raises `UsageError` as `linearise`, and for a loop whose stability rounding may decide.
    """
    expect_sampled(request, component)
    for one, other, interval in stepped_couplings(system_of(request_of(request))):
        warn(
            f"{one} and {other} run in continuous time, and exchange every {quantity(interval, 's')}: the loop is that "
            "of this stepped coupling; with shorter steps the margins may differ"
        )
    return in_isolation(request, _bode, component)


def stepped_couplings(system: System) -> list[tuple[str, str, float]]:
    """Pairs of components in continuous time that are connected, with the longer one of their steps [s]."""
    steps = {name: one.step for name, one in system.components.items() if one.sampling is None and one.step is not None}
    pairs = dict.fromkeys((x.sender, x.receiver) for x in system.connections)
    return [
        (one, other, max(steps[one], steps[other]))
        for one, other in pairs
        if one in steps and other in steps and not ((other, one) in pairs and other < one)
    ]


def expect_decided(loop: Linearised) -> None:
    """Raise `UsageError` for a loop whose stability rounding may decide, or whose halves are not the whole of it."""
    whole, by_halves = loop.radius, radius(loop)
    if abs(whole - 1.0) < NEAR_ONE:
        raise UsageError(f"the loop is neither stable nor unstable: its spectral radius is {whole:.9g}, which is 1")
    later = np.tri(loop.samples, k=-1, dtype=bool)  # what is measured follows from commands of earlier samples
    follows = np.kron(later, np.ones(np.array(loop.rest.D.shape) // loop.samples, dtype=bool))
    if loop.rest.D[~follows].any() or (whole < 1.0) != (max(whole, by_halves) < 1.0):
        raise UsageError(
            f"the loop as a whole has a spectral radius of {whole:.6g}, its two halves one of {by_halves:.6g}: "
            "the loop cannot be cut open there"
        )


def _bode(request: Request, component: str | None) -> Bode:
    with errors_in_own_terms(request), closing(Instances()) as instances:
        system = rested(request)
        name = sampled_component(system, component)
        models = files_of(system).models_of(system)
        with progress_bar("margins") as report, whole_at_rest(system, instances, models=models) as rest:
            loop, calm = cut_open(rest, name), rest.simulation.system

            @cache
            def later(delay: float) -> StateSpace:
                return rest_of_loop(rest, name, delayed(calm, name, delay).connections)

            turn = loop.samples if calm.uses_scheduler else 1
            late = Late(rest=later, jumps=jumps_of(calm, name), turn=turn)
            expect_decided(loop)
            frequencies, stable = _frequencies(loop), loop.radius < 1.0
            curves = [lifted_gains(loop, i, frequencies) for i in _commands(loop)]
            gains = np.array([curve for curve, _ in curves])
            half = math.pi / loop.rest.dt  # of the period: beyond are the same gains
            below = np.append(frequencies[frequencies < half], half)
            each = (_margins(loop, i, below, curves[i][1], late, system) for i in _commands(loop))
            found = list[LoopMargins]()
            for margins in each if stable else ():
                found.append(margins)
                report(len(found) / len(gains))
    return Bode(
        dt=loop.dt, samples=loop.samples, stable=stable, radius=loop.radius, loops=tuple(found),
        outputs=tuple(_output(loop, i) for i in _commands(loop)), frequencies=frequencies, gains=gains,
        in_double=loop.in_double,
        sensitivity_peak=max((each.sensitivity_peak for each in found), default=None),
    )  # fmt: skip


def delayed(system: System, name: str, delay: float) -> System:
    """The system with a further delay [s] of all that a component sends."""
    connections = (
        x.with_delay(lowest(x.delay) + delay) if x.sender == name and delay else x for x in system.connections
    )
    return replace(system, connections=tuple(connections))


def receivers_of(request: RequestLike, output: str) -> str:
    """The inputs that an output is connected to, as COMPONENT.VARIABLE."""
    connections = system_of(request_of(request)).connections
    return ", ".join(end for x in connections for start, end in zip(x.start, x.end) if start == output)


def _commands(loop: Linearised) -> range:
    return range(len(loop.component.outputs) // loop.samples)


def _output(loop: Linearised, i: int) -> str:
    return f"{loop.name}.{loop.component.outputs[i].removesuffix('[0]')}"


def _margins(loop: Linearised, i: int, frequencies: Floats, peak: float, late: Late, system: System) -> LoopMargins:
    """The margins of a command at all of its samples in a period."""
    output, reason, delay = _output(loop, i), "", None
    turn, crossover = phase_margin(loop, i, frequencies) or (None, None)
    factors = tuple(GainMargin(factor=factor, frequency=at) for factor, at in gain_margins(loop, i, frequencies))
    try:
        delay = delay_margin(loop, i, frequencies, late)
    except UsageError as error:
        reason = str(error)
    return LoopMargins(
        input=receivers_of(system, output),
        output=output,
        gain_margin=min((one.factor for one in factors), key=lambda one: abs(math.log(one)), default=None),
        gain_margins=factors,
        phase_margin=None if turn is None else math.degrees(turn),
        delay_margin=delay,
        delay_reason=reason,
        crossover=crossover,
        sensitivity_peak=peak,
    )


def _frequencies(loop: Linearised) -> Floats:
    """Frequencies at which loops are evaluated [rad/s]: even in the logarithm, and closer about those of poles.

    Of several samples a period none is a whole number of turns in it: there poles of 1, as of a position, are infinite.
    """
    dt = loop.rest.dt
    top = math.pi / loop.dt
    of_closed = _rates(closed(loop).A, dt)
    rates = np.concatenate([of_closed, _rates(loop.rest.A, dt), _rates(loop.component.A, dt)])
    low = max(SLOWER * float(np.abs(of_closed).min(initial=top)), LOWEST * top)
    about = [abs(rate.imag) + BESIDE_A_POLE * max(abs(rate.real), 1e-3 * abs(rate.imag)) for rate in rates]
    found = np.concatenate([np.geomspace(low, top, FREQUENCIES), *about])
    turns = found * dt / (2.0 * math.pi)
    infinite = (turns > 0.5) & (np.abs(turns - np.round(turns)) < BESIDE_A_TURN)
    return np.unique(found[(found >= low) & (found <= top) & ~infinite])


def _rates(A: Floats, dt: float) -> Complexes:
    """The rates of decay and rotation of the motions of a matrix that do not end at once [1/s]."""
    poles = np.linalg.eigvals(A).astype(complex)
    rates: Complexes = np.log(poles[np.abs(poles) > LOWEST]) / dt
    return rates
