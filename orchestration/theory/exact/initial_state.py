"""The initial state of a system, as deviations from rest."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from orchestration.components.fmi.instance import Instance
from orchestration.components.fmi.reuse import Instances
from orchestration.foundation.basics.errors import UsageError
from orchestration.foundation.basics.simulator import Floats
from orchestration.simulation.runs.prepared import prepared
from orchestration.systems.system.model import System
from orchestration.systems.system.paths import changed
from orchestration.theory.stability.linearised_component import Tangent
from orchestration.theory.stability.loop_at_rest import AtRest, tracing_loader
from orchestration.theory.stability.matrices import Components
from orchestration.theory.stability.operating_point import deterministic


@dataclass(frozen=True, kw_only=True)
class InitialState:
    """Deviations from rest after the first exchange, which is never lost, late or noisy."""

    states: Mapping[str, Floats]
    """States by component"""
    outputs: Mapping[str, Floats]
    """likewise"""
    received: Mapping[str, Floats]
    """Received values by connection"""


def initial_state_of(
    system: System, loop: AtRest, parts: Components, tangents: Mapping[str, Tangent], instances: Instances
) -> InitialState:
    """The initial state of `system`, in the coordinates of the components `parts` of its loop at rest.

    Raises `UsageError` where it is outside of the linear range.
    """
    _expect_same_sources(system)
    calm = deterministic(replace(system, operating_point={}))
    prompt = {
        name: one if one.sampling is None else replace(one, sampling=replace(one.sampling, offset=0.0))
        for name, one in calm.components.items()
    }
    with prepared(replace(calm, components=prompt), load=tracing_loader(instances)) as run:
        run.master.initialise()
        if run.master.divergence is not None:
            raise UsageError(f"it diverges at its initialisation: {run.master.divergence}")
        saved = {name: instance.save() for name, instance in run.instances.items()}
        outputs = {name: _outputs(run.instances[name], part.outputs) for name, part in parts.items()}
        received = [channel.received.copy() for channel in run.master.running.channels]
    for name, state in loop.saved_states.items():
        loop.simulation.instances[name].restore(state)
    rest = {name: _outputs(loop.simulation.instances[name], part.outputs) for name, part in parts.items()}
    received_at_rest = [channel.received for channel in loop.simulation.master.running.channels]
    return InitialState(
        states={name: tangents[name].coordinates_of(saved[name]) for name in parts},
        outputs={name: outputs[name] - rest[name] for name in parts},
        received={x.name: now - then for x, now, then in zip(system.connections, received, received_at_rest)},
    )


def _outputs(instance: Instance, names: tuple[str, ...]) -> Floats:
    return np.array([float(instance.get(name)) for name in names])


def _expect_same_sources(system: System) -> None:
    """Raise `UsageError` for a source that drives the system away from rest."""
    at_rest = changed(system, system.operating_point)
    for name, source in system.sources.items():
        if not source.is_held or source.constant != at_rest.sources[name].constant:
            raise UsageError(
                f"sources.{name}: expected noise, or a constant that is the same at the operating point: over a "
                "horizon only initial conditions differ from it"
            )
