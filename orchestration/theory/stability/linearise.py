"""A system about its operating point, cut open at one component: that component, and the rest of the loop."""

import math
from collections.abc import Callable, Sequence
from contextlib import closing, nullcontext
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from orchestration.components.fmi.foreign_calls import isolated_call
from orchestration.components.fmi.reuse import Instances
from orchestration.foundation.basics.errors import UsageError, told_apart
from orchestration.foundation.basics.terminal import progress_bar
from orchestration.foundation.basics.times import NANOSECONDS
from orchestration.foundation.basics.unit_algebra import counted, quantity
from orchestration.foundation.processes.passable import passable
from orchestration.simulation.requests.request import RequestLike, request_of
from orchestration.simulation.runs.replacement import component_named
from orchestration.simulation.workers.choice import single_run_execution
from orchestration.systems.system.connection import Connection
from orchestration.systems.system.files import files_of
from orchestration.systems.system.model import System
from orchestration.systems.system.request import Request, errors_in_own_terms, system_of
from orchestration.theory.stability.fixed_periods import inform_of_uneven
from orchestration.theory.stability.in_double import of_code
from orchestration.theory.stability.known_loops import rested, warned_of_timing
from orchestration.theory.stability.lifted_component import lifted_names
from orchestration.theory.stability.linear_simulator import OpenPort
from orchestration.theory.stability.loop_at_rest import AtRest, expect_whole_instances, whole_at_rest
from orchestration.theory.stability.matrices import of_lifted
from orchestration.theory.stability.operating_point import inform_of_chance, turn_of
from orchestration.theory.stability.period_map import period_map
from orchestration.theory.stability.poles import Pole, as_poles, poles_of
from orchestration.theory.stability.state_space import StateSpace, reduced

Found = TypeVar("Found")
Asked = TypeVar("Asked")

NEAR_ONE = 1e-7
"""Distance of a spectral radius from 1 that rounding may explain"""


@passable
@dataclass(frozen=True, kw_only=True)
class Linearised:
    """A loop about its operating point, as two linear systems in feedback."""

    name: str
    """The component at which it is cut open."""
    component: StateSpace
    """Loop of that component: inputs are its measurements, outputs its commands."""
    rest: StateSpace
    """The rest of the loop, from sample to sample: inputs are the commands, outputs the measurements at the next
    sample, with holds, delays and the other components in between."""
    operating_point: dict[str, float]
    """The values about which it is linear, by COMPONENT.VARIABLE: of all columns of a run, and of the component's
    inputs."""
    samples: int = 1
    """Samples of the component in a period of the loop, over which both halves go: more than 1 where others are slower,
    or its own code has slower tasks. The signals of sample k end in [k] then: [0] is the sample after that in which all
    rates meet, which is the last."""
    radius: float
    """The spectral radius of the whole loop, closed, over a period, with what its halves leave out: below 1 small
    deviations decay."""
    poles: tuple[Pole, ...]
    """The poles of the whole loop, as `radius`, the slowest first, without those at 0."""
    turn: float | None = None
    """Whole turns in the period of several rates [rad/s]: by multiples of it the frequency of a pole may be another;
    None: one rate."""
    in_double: tuple[str, ...] = ()
    """The components whose float code in C is taken in double precision."""

    def __repr__(self) -> str:
        return f"<Linearised: {self.verdict}>"

    @property
    def verdict(self) -> str:
        """Whether the linear loop is stable, and its sizes."""
        law, rest = (counted(len(half.A), "state") for half in (self.component, self.rest))
        sizes = f"{self.name} with {law}, the rest with {rest}, those that inputs reach and outputs show"
        return f"{stability_of(self.radius)}, {self.clock}: {sizes}{of_code(self.in_double)}"

    @property
    def dt(self) -> float:
        """Time from sample to sample of the component [s]."""
        return self.rest.dt / self.samples

    @property
    def clock(self) -> str:
        """When it is sampled, and how long the period of the loop is, in words."""
        return clock_of(self.dt, self.samples)


def linearise(request: RequestLike, component: str | None = None) -> Linearised:
    """The loop of a system, or a scenario, about its operating point, cut open at a sampled component.

    Default `component`: the only sampled one. A system rests at the `[operating_point]` of its file, else at its
    initial conditions; a scenario hovers. Jitter, loss, noise and quantisation are left out, delays, holds and the
    order of exchange are included. States are coordinates without physical meaning: those of `rest` are controllable
    from the command and observable from the measurement.

    Raises `UsageError` for a system that does not rest there, for FMUs that cannot save their state, and for a
    component that is not sampled. Where several rates meet, both halves go over a period of all.
    """
    expect_sampled(request, component)
    return in_isolation(request, _linearised, component)


def in_isolation(
    request: RequestLike, find: Callable[[Request, Asked], Found], asked: Asked, *, is_loop: bool = True
) -> Found:
    """What `find` says of a request and, say, a component, in a process that may load its FMUs, or their twins."""
    loaded, _ = single_run_execution(request_of(request), "auto")
    with errors_in_own_terms(loaded):
        files = files_of(system := system_of(loaded))
        if is_loop:
            inform_of_chance(system)
            inform_of_uneven(system)
        with warned_of_timing(system, files) if is_loop else nullcontext():
            return isolated_call(files.fmus.values(), find, loaded, asked)


def _linearised(request: Request, component: str | None) -> Linearised:
    with errors_in_own_terms(request), closing(Instances()) as instances:
        system = rested(request)
        name = sampled_component(system, component)
        with progress_bar("linear models"), whole_at_rest(system, instances) as loop:
            return cut_open(loop, name)


def expect_sampled(request: RequestLike, component: str | None) -> None:
    """Raise `UsageError`, before any FMU is built, where no sampled component has that name, or several might."""
    with errors_in_own_terms(asked := request_of(request)):
        sampled_component(rested(asked, checked=False), component)


def sampled_component(system: System, component: str | None) -> str:
    """The component at which a loop is cut open; raises `UsageError` for one that is not sampled."""
    expect_whole_instances(system)
    if all(each.sampling is None for each in system.components.values()):
        raise UsageError(
            "nothing is sampled, so that there is no loop to cut open: expected a controller with sampling = "
            "{ period = SECONDS }, as quadcosim connect PLANT.fmu CONTROLLER.fmu proposes; the matrices of one FMU are "
            "those of quadcosim linearise PLANT.fmu, in Python plant_at_start"
        )
    return component_named(system, component, "at which to cut the loop open, the others closed", only_sampled=True)


def cut_open(loop: AtRest, name: str) -> Linearised:
    """A loop at rest, cut open at a sampled component."""
    sampling = loop.simulation.system.components[name].sampling
    assert sampling is not None
    rest, samples = rest_of_loop(loop, name), samples_of(loop, name)
    board, at_samples = loop.simulation.master.board, loop.rest_of(name)
    point = {column: float(board.row[place]) for column, place in board.place.items() if column != "time"}
    point |= {f"{name}.{end}": value for end, value in zip(at_samples.inputs, at_samples.held.tolist())}
    whole = period_map(loop)
    return Linearised(
        name=name,
        component=StateSpace(**vars(of_lifted(loop.tangents[name], sampling.period, samples)), dt=rest.dt),
        rest=rest,
        operating_point=point,
        samples=samples,
        radius=float(np.abs(np.linalg.eigvals(whole)).max(initial=0.0)),
        poles=as_poles(poles_of(whole), rest.dt),
        turn=turn_of(loop.simulation.system, rest.dt),
        in_double=loop.in_double,
    )


def rest_of_loop(loop: AtRest, name: str, connections: Sequence[Connection] | None = None) -> StateSpace:
    """The rest of a loop at rest, as a sampled component sees it, by other `connections` if any."""
    tangent, samples = loop.tangents[name], samples_of(loop, name)
    port, dt = OpenPort(tangent.inputs, tangent.outputs, samples), float(loop.period) / NANOSECONDS
    whole = period_map(loop, {name: port}, connections)
    size = len(whole) - len(port.received)
    A, B, C = reduced(whole[:size, :size], whole[:size, size:], whole[size:, :size])
    return StateSpace(
        A=A, B=B, C=C, D=np.array(whole[size:, size:]), dt=dt,
        inputs=lifted_names(port.outputs, samples), outputs=lifted_names(port.inputs, samples),
    )  # fmt: skip


def samples_of(loop: AtRest, name: str) -> int:
    """The samples of a component in a period of a loop."""
    sampling = loop.simulation.system.components[name].sampling
    assert sampling is not None
    return int(loop.period / sampling.true_period)


def clock_of(dt: float, samples: int) -> str:
    """When a component is sampled, every `dt` [s], and how long the period of its loop is, in words."""
    often = f"sampled every {quantity(dt, 's')}"
    return often if samples == 1 else f"{often}, in a period of all rates of {quantity(samples * dt, 's')}"


def stability_of(radius: float) -> str:
    """Whether a loop with a spectral radius is stable, in words."""
    if math.isclose(radius, 1.0, abs_tol=NEAR_ONE):
        return f"not decidably stable: spectral radius {radius:.9g}"
    return f"{'stable' if radius < 1.0 else 'unstable'}: spectral radius {told_apart(radius, 1.0, digits=4)[0]}"
