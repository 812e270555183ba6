"""A system about its operating point, cut open at one component: that component, and all else as it sees it."""

from dataclasses import dataclass

import numpy as np

from orchestration.basics.errors import UsageError
from orchestration.fmi.reuse import Instances
from orchestration.requests.request import RequestLike, request_of
from orchestration.runs.replacement import component_named
from orchestration.stability.known_loops import rested
from orchestration.stability.linear_loop import AtRest, at_rest, map_of
from orchestration.stability.linear_simulator import Opened
from orchestration.stability.operating_point import true_period
from orchestration.stability.state_space import StateSpace, reduced
from orchestration.system.request import errors_in_own_terms
from orchestration.system.times import NANOSECONDS


@dataclass(frozen=True, kw_only=True)
class Linearised:
    """A loop about its operating point, as two linear systems that are each other's inputs and outputs."""

    name: str
    """Of the component at which it is cut open."""
    component: StateSpace
    """That component: what it measures in, what it commands out."""
    rest: StateSpace
    """All else, from sample to sample: its command in, what it measures at the next sample out, with holds, delays and
    the other components in between."""


def linearise(asked: RequestLike, component: str | None = None) -> Linearised:
    """The loop of a system, or a scenario, about its operating point, cut open at a component that is sampled.

    Without a `component` at the only one that is sampled. A system rests where its file has `[operating_point]`, else
    where it begins; a scenario hovers. Jitter, loss, noise and quantisation are left out, delays, holds and the order
    of exchange are in. States are coordinates without a meaning of their own: those of `rest` are the ones that the
    command moves and the measurement shows.

    Raises `UsageError` where nothing rests there, for FMUs that cannot save their state, and for a component that is
    not sampled, or more often than another one.
    """
    request = request_of(asked)
    instances = Instances()
    try:
        with errors_in_own_terms(request):
            system = rested(request)
            name = component_named(system, component, "at which to cut the loop open")
            if system.components[name].sampling is None:
                raise UsageError(f"component: {name}: expected one that is sampled")
            with at_rest(system, instances) as loop:
                return _opened(loop, name)
    finally:
        instances.close()


def _opened(loop: AtRest, name: str) -> Linearised:
    sampling, tangent = loop.simulation.system.components[name].sampling, loop.tangents[name]
    assert sampling is not None
    if true_period(sampling) != loop.period:
        raise UsageError(
            f"component: {name}: expected the only rate of the system, or the slowest, which others divide"
        )
    port, dt = Opened(tangent.inputs, tangent.outputs), float(loop.period) / NANOSECONDS
    whole = map_of(loop, {name: port})
    size = len(whole) - len(port.inputs)
    A, B, C = reduced(whole[:size, :size], whole[:size, size:], whole[size:, :size])
    by_state, by_input = tangent.derivatives(sampling.period)
    cut = len(port.outputs)
    return Linearised(
        name=name,
        component=StateSpace(
            A=by_state[cut:], B=by_input[cut:], C=by_state[:cut], D=by_input[:cut], dt=dt, inputs=port.inputs,
            outputs=port.outputs,
        ),
        rest=StateSpace(
            A=A, B=B, C=C, D=np.array(whole[size:, size:]), dt=dt, inputs=port.outputs, outputs=port.inputs
        ),
    )  # fmt: skip
