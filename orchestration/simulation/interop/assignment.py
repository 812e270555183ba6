"""The task of every tool: the connections of a system and the signals that are compared."""

from collections.abc import Mapping
from dataclasses import dataclass

from orchestration.components.fmi.read_description import Kind
from orchestration.foundation.basics.errors import UsageError
from orchestration.simulation.interop.job import End
from orchestration.simulation.requests.ssp.export import Export
from orchestration.systems.system.connection import variable_of


@dataclass(frozen=True, kw_only=True)
class Ports:
    """The connected variables of a component."""

    inputs: tuple[str, ...]
    outputs: tuple[str, ...]


@dataclass(frozen=True, kw_only=True)
class AssignedLoop:
    """The connections of a system, and its compared signals."""

    ports: Mapping[str, Ports]
    """Ports by component, in the order for tools that step one after the other"""
    connections: tuple[tuple[End, End], ...]
    """output to input"""
    states: tuple[str, ...]
    """connected outputs of components in continuous time, as COMPONENT.VARIABLE, at the end of a step"""
    commands: tuple[str, ...]
    """those of sampled components: a step returns the value computed at its start"""

    kinds: Mapping[End, Kind]
    """Kinds of every connected variable"""

    @property
    def converted(self) -> tuple[str, ...]:
        """Connections that are not from a Real to a Real."""
        other = [(start, end) for start, end in self.connections if {self.kinds[start], self.kinds[end]} != {"Real"}]
        kinds = self.kinds
        return tuple(dict.fromkeys(f"{'.'.join(start)} ({kinds[start]} to {kinds[end]})" for start, end in other))

    @property
    def signals(self) -> tuple[str, ...]:
        """The columns of a tool's rows after the time."""
        return self.states + self.commands

    def feeding(self, component: str) -> dict[str, End]:
        """The output behind each connected input of a component, in the order of its ports."""
        behind = {end: start for start, end in self.connections}
        return {name: behind[component, name] for name in self.ports[component].inputs}


def assigned_loop(export: Export) -> AssignedLoop:
    """The loop of a system; raises `UsageError` for a connection with scale or offset."""
    for x in export.system.connections:
        if x.converts:
            raise UsageError(f"connections.{x.name}: has scale or offset; expected none to compare with other masters")
    sampled = {name for name, component in export.system.components.items() if component.sampling is not None}
    outputs = [(part.name, f"{part.name}.{name}") for part in export.parts for name in part.outputs]
    return AssignedLoop(
        ports={part.name: Ports(inputs=part.inputs, outputs=part.outputs) for part in export.parts},
        connections=tuple(
            ((x.sender, variable_of(start)), (x.receiver, variable_of(end)))
            for x in export.system.connections
            for start, end in zip(x.start, x.end, strict=True)
        ),
        kinds={
            (part.name, name): part.variable(name).kind for part in export.parts for name in part.inputs + part.outputs
        },
        states=tuple(signal for owner, signal in outputs if owner not in sampled),
        commands=tuple(signal for owner, signal in outputs if owner in sampled),
    )
