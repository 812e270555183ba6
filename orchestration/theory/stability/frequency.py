"""Loops in the frequency domain: each command's loop, the others closed, with its margins as a sampled loop."""

import math
from contextlib import closing
from dataclasses import replace
from functools import cache
from typing import overload

import numpy as np

from orchestration.components.fmi.reuse import Instances
from orchestration.foundation.basics.errors import UsageError
from orchestration.foundation.basics.simulator import Floats
from orchestration.foundation.basics.terminal import Share, inform, progress_bar, warn
from orchestration.foundation.basics.unit_algebra import quantity
from orchestration.simulation.requests.request import RequestLike, request_of
from orchestration.systems.schedule.plan import reaches
from orchestration.systems.system.distribution import lowest
from orchestration.systems.system.files import files_of
from orchestration.systems.system.model import System
from orchestration.systems.system.request import Request, errors_in_own_terms, system_of
from orchestration.theory.stability.delay_margin import Late, delay_margin, jumps_of
from orchestration.theory.stability.known_loops import rested
from orchestration.theory.stability.lifted_margins import gain_margins, lifted_gains, phase_margin
from orchestration.theory.stability.linearise import (
    NEAR_ONE,
    Linearised,
    cut_open,
    in_isolation,
    rest_of_loop,
    sampled_component,
)
from orchestration.theory.stability.loop_at_rest import AtRest, expect_whole_instances, whole_at_rest
from orchestration.theory.stability.loop_halves import closed, radius
from orchestration.theory.stability.loop_margins import Bode, Bodes, GainMargin, LoopMargins
from orchestration.theory.stability.poles import Complexes
from orchestration.theory.stability.state_space import StateSpace

LOWEST = 1e-5
"""Lowest frequency, as a share of the highest"""
SLOWER = 0.03
"""Lowest frequency, as a share of the slowest rate of the closed loop: below are the integrators alone"""
FREQUENCIES = 1500
BESIDE_A_POLE = np.linspace(-4.0, 4.0, 17)
"""Further frequencies about that of a pole, in units of its damping"""
MOST_SAMPLES = 20
"""Samples of a component in the period of its loop, at most: the matrices over it grow with them"""
BESIDE_A_TURN = 1e-4
"""Least distance of a frequency from whole turns in a period of several samples"""


@overload
def bode(request: RequestLike, component: str) -> Bode: ...
@overload
def bode(request: RequestLike, component: None = None) -> Bode | Bodes: ...
def bode(request: RequestLike, component: str | None = None) -> Bode | Bodes:
    """The loop gains of a sampled component with all holds and delays, about the operating point, and their margins.

    As `linearise`, of which it is the frequency response. Each loop is cut at one command, with the others closed.
    Without `component` those of each sampled component whose commands come back to it: `Bodes` if there are several. A
    delay margin is exact also for parts of a period: the loop is linearised with it.

    Raises `UsageError` as `linearise`, and for a loop whose stability rounding may decide.
    """
    with errors_in_own_terms(asked := request_of(request)):
        names = _cut_at(rested(asked, checked=False), component)
    for one, other, interval in stepped_couplings(system_of(request_of(request))):
        warn(
            f"{one} and {other} run in continuous time, and exchange every {quantity(interval, 's')}: the loop is that "
            "of this stepped coupling; with shorter steps the margins may differ"
        )
    found = in_isolation(request, _bode, names)
    return found[names[0]] if len(names) == 1 else Bodes(components=found)


def _cut_at(system: System, component: str | None) -> list[str]:
    """The sampled components whose loops are asked for: those whose commands come back to them."""
    asked = [name for name, each in system.components.items() if each.sampling is not None]
    if component is not None or len(asked) < 2:
        asked = [sampled_component(system, component)]
    expect_whole_instances(system)
    receivers = {name: {x.receiver for x in system.connections if x.sender == name} for name in system.components}
    found = [name for name in asked if any(reaches(receivers, one, name) for one in receivers[name])]
    left = [name for name in asked if name not in found]
    if not found:
        raise UsageError(
            f"no loop goes through {', '.join(left)}: expected a sampled component to which connections "
            "bring back what it sends"
        )
    if left:
        inform(f"in no loop, left out: {', '.join(left)}")
    return found


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
            f"the loop cannot be cut open at {loop.name}"
        )


def _bode(request: Request, names: list[str]) -> dict[str, Bode]:
    with errors_in_own_terms(request), closing(Instances()) as instances:
        system = rested(request)
        models = files_of(system).models_of(system)
        with progress_bar("margins") as report, whole_at_rest(system, instances, models=models) as rest:
            found, refused = dict[str, Bode](), dict[str, UsageError]()
            for name in names:
                try:
                    found[name] = _of_component(
                        rest, name, system, lambda share: report((len(found) + len(refused) + share) / len(names))
                    )
                except UsageError as error:
                    refused[name] = error
            for reason in refused.values():
                if not found:
                    raise reason
                inform(f"left out: {reason}")
            return found


def _of_component(rest: AtRest, name: str, system: System, report: Share) -> Bode:
    loop, calm = cut_open(rest, name), rest.simulation.system
    if loop.samples > MOST_SAMPLES:
        raise UsageError(
            f"{name} samples {loop.samples} times in the period of its loop, {quantity(loop.samples * loop.dt, 's')}; "
            f"expected {MOST_SAMPLES} times at most"
        )

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
