"""What every tool flies: the wires of a system and the signals that are compared."""

from collections.abc import Mapping
from dataclasses import dataclass

from orchestration.basics.errors import UsageError
from orchestration.fmi.model import Kind
from orchestration.interop.job import End
from orchestration.requests.ssp.export import Export
from orchestration.system.variable_names import variable_of


@dataclass(frozen=True, kw_only=True)
class Ports:
    """The connected variables of a component."""

    inputs: tuple[str, ...]
    outputs: tuple[str, ...]


@dataclass(frozen=True, kw_only=True)
class Loop:
    """Who is connected to whom."""

    ports: Mapping[str, Ports]
    """by component, in the order in which a tool that steps one after the other takes them"""
    connections: tuple[tuple[End, End], ...]
    """output to input"""
    states: tuple[str, ...]
    """connected outputs of components in continuous time, as COMPONENT.VARIABLE: of the end of a step"""
    commands: tuple[str, ...]
    """of sampled ones: a step gives what it computed at its start"""

    kinds: Mapping[End, Kind]
    """of every connected variable"""

    @property
    def converted(self) -> tuple[str, ...]:
        """Outputs that are no Reals, or do not go to Reals."""
        mixed = [start for start, end in self.connections if {self.kinds[start], self.kinds[end]} != {"Real"}]
        return tuple(dict.fromkeys(".".join(start) for start in mixed))

    @property
    def signals(self) -> tuple[str, ...]:
        """Columns of a tool's record beside the time."""
        return self.states + self.commands

    def feeding(self, component: str) -> dict[str, End]:
        """The output behind each connected input of a component, in the order of its ports."""
        behind = {end: start for start, end in self.connections}
        return {name: behind[component, name] for name in self.ports[component].inputs}


def loop_of(given: Export) -> Loop:
    """The loop of a system; raises `UsageError` for a connection that does not pass on values as they are."""
    for x in given.system.connections:
        if x.converts:
            raise UsageError(f"connections.{x.name}: has scale or offset; expected none to compare with other masters")
    sampled = {name for name, component in given.system.components.items() if component.sampling is not None}
    outputs = [(part.name, f"{part.name}.{name}") for part in given.parts for name in part.outputs]
    return Loop(
        ports={part.name: Ports(inputs=part.inputs, outputs=part.outputs) for part in given.parts},
        connections=tuple(
            ((x.sender, variable_of(start)), (x.receiver, variable_of(end)))
            for x in given.system.connections
            for start, end in zip(x.start, x.end, strict=True)
        ),
        kinds={
            (part.name, name): part.variable(name).kind for part in given.parts for name in part.inputs + part.outputs
        },
        states=tuple(signal for owner, signal in outputs if owner not in sampled),
        commands=tuple(signal for owner, signal in outputs if owner in sampled),
    )
