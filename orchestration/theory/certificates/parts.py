"""The matrices of a system's components about its operating point, and the layout of their common state."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction

import numpy as np

from orchestration.foundation.basics.errors import UsageError
from orchestration.foundation.basics.simulator import Floats
from orchestration.foundation.basics.times import NANOSECONDS, exact_nanoseconds
from orchestration.systems.schedule.plan import Plan
from orchestration.systems.system.connection import Connection, variable_of
from orchestration.systems.system.model import System
from orchestration.theory.stability.loop_at_rest import AtRest
from orchestration.theory.stability.matrices import (
    Matrices,
    depends_on_step,
    in_continuous_time,
    in_output_coordinates,
    of_samples,
)
from orchestration.theory.stability.operating_point import true_period

Place = tuple[str, ...]
"""of the state: kind, component or connection, and index or name"""


@dataclass(frozen=True, kw_only=True)
class CertifiedLoop:
    """A system about its operating point, as matrices; times are exact, in nanoseconds."""

    system: System
    components: Mapping[str, Matrices]
    period: Fraction
    """the hyperperiod"""
    order: Sequence[str]
    """of sampled components at one instant"""
    step_dependent: frozenset[str] = frozenset()
    """sampled components whose samples depend on the time to the next one"""

    def samples_of(self, name: str) -> list[Fraction]:
        """The instants of a component within a period of the loop."""
        sampling = self.system.components[name].sampling
        assert sampling is not None
        step = true_period(sampling)
        first = exact_nanoseconds(sampling.offset) / Fraction(repr(float(sampling.clock_ratio)))
        return [(first + k * step) % self.period for k in range(round(self.period / step))]

    def connection(self, name: str) -> Connection:
        """The connection of a name."""
        return next(x for x in self.system.connections if x.name == name)

    def is_sampled(self, name: str) -> bool:
        """Whether a component is a digital task."""
        return self.system.components[name].sampling is not None

    def feeds_through(self, name: str) -> bool:
        """Whether inputs of a component in continuous time act on its outputs at once: on those read later."""
        return not self.is_sampled(name) and bool(self.components[name].D.any())


def certified_loop(rest: AtRest) -> CertifiedLoop:
    """The loop of a system at rest; raises `UsageError` for an unsupported one."""
    from scipy.linalg import expm  # comes with an extra

    system = rest.simulation.system
    for x in system.connections:
        if x.hold != "zero":
            raise UsageError(f"connections.{x.name}.hold: expected zero")
        if system.components[x.sender].sampling is None and system.components[x.receiver].sampling is None:
            raise UsageError(f"connections.{x.name}: expected a sampled component at one of its ends")
    period = float(rest.period) / NANOSECONDS
    components, step_dependent = {}, set()
    for name, component in system.components.items():
        tangent = rest.tangents[name]
        if component.sampling is not None:
            found = of_samples(tangent, component.sampling.period)
            components[name] = in_output_coordinates(found, found.A)
            varies = rest.simulation.instances[name].model.varies_step
            if not varies or depends_on_step(tangent, component.sampling.period):
                step_dependent.add(name)
        else:
            assert component.step is not None
            found, unfit = in_continuous_time(tangent, min(component.step, period))
            if unfit is not None:
                raise UsageError(f"{name}: {unfit}, so it is no linear system in continuous time")
            components[name] = in_output_coordinates(found, expm(found.A * period))
    for x in system.connections:
        for start, end in zip(x.start, x.end):
            known = (components[x.sender].outputs, components[x.receiver].inputs)
            if variable_of(start) not in known[0] or variable_of(end) not in known[1]:
                raise UsageError(f"connections.{x.name}: carries {start}, which is no Real")
    return CertifiedLoop(
        system=system,
        components=components,
        period=rest.period,
        order=Plan(system).sampled,
        step_dependent=frozenset(step_dependent),
    )


@dataclass(kw_only=True)
class StateLayout:
    """The places of the state: states of components, held inputs, messages in transit."""

    loop: CertifiedLoop
    kept: frozenset[str] = frozenset()
    """connections whose last message is remembered, as later ones may be lost"""
    places: dict[Place, int] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for name, matrices in self.loop.components.items():
            for i in range(len(matrices.A)):
                self.place(("state", name, str(i)))
            for end in matrices.inputs:
                if not self.loop.is_sampled(name) or not self._is_fresh(name, end):
                    self.place(("input", name, end))

    def _is_fresh(self, name: str, end: str) -> bool:
        """Whether an input of a sampled component is measured anew for each of its samples."""
        x = next(x for x in self.loop.system.connections if f"{name}.{end}" in x.end)
        return not self.loop.is_sampled(x.sender) and x.name not in self.kept

    def place(self, of: Place) -> int:
        """Its index; at the end, if it is new."""
        return self.places.setdefault(of, len(self.places))

    def flow(self) -> Floats:
        """The generator of the flow between instants."""
        found: Floats = np.zeros((len(self.places), len(self.places)))
        for name, matrices in self.loop.components.items():
            if self.loop.is_sampled(name):
                continue
            states = [self.places["state", name, str(i)] for i in range(len(matrices.A))]
            inputs = [self.places["input", name, end] for end in matrices.inputs]
            found[np.ix_(states, states)], found[np.ix_(states, inputs)] = matrices.A, matrices.B
        return found


class InstantMap:
    """The linear map of an instant, built by assignments one after the other: a row for every place."""

    def __init__(self, layout: StateLayout, size: int) -> None:
        self.layout = layout
        self.rows: Floats = np.eye(size)
        self._read: dict[tuple[str, str], Floats] = {}

    def measure(self, x: Connection) -> list[Floats]:
        """The values that a connection reads from a component in continuous time."""
        of, layout = self.layout.loop.components[x.sender], self.layout
        states = self.rows[[layout.places["state", x.sender, str(i)] for i in range(len(of.A))]]
        inputs = self.rows[[layout.places["input", x.sender, end] for end in of.inputs]]
        outputs = of.C @ states + of.D @ inputs
        return [x.scale * outputs[of.outputs.index(variable_of(start))] for start in x.start]

    def receive(self, x: Connection, values: Sequence[Floats]) -> None:
        """A message arrives."""
        for end, value in zip(x.end, values):
            key = ("input", x.receiver, variable_of(end))
            if key in self.layout.places:
                self.rows[self.layout.places[key]] = value
            self._read[x.receiver, variable_of(end)] = value

    def push(self, x: Connection, values: Sequence[Floats], count: int) -> None:
        """A message is sent, with `count` of them in transit already."""
        for i, value in enumerate(values):
            self.rows[self.layout.place(("message", x.name, str(count), str(i)))] = value

    def pop(self, x: Connection, count: int) -> list[Floats]:
        """The oldest message in transit is removed, and the others move up."""
        at = [
            [self.layout.place(("message", x.name, str(k), str(i))) for i in range(len(x.start))] for k in range(count)
        ]
        values = list(self.rows[at[0]])
        for k in range(count - 1):
            self.rows[at[k]] = self.rows[at[k + 1]]
        self.rows[at[-1]] = 0.0
        return values

    def remember(self, x: Connection, values: Sequence[Floats] | None) -> list[Floats]:
        """The values sent last, which are replaced by `values` if these are not lost."""
        at = [self.layout.place(("last", x.name, str(i))) for i in range(len(x.start))]
        if values is not None:
            self.rows[at] = values
        return list(self.rows[at])

    def sample(self, name: str) -> dict[str, Floats]:
        """A sampled component steps; its outputs."""
        of, layout = self.layout.loop.components[name], self.layout
        at = [layout.places["state", name, str(i)] for i in range(len(of.A))]
        size = len(self.rows)
        states = self.rows[at].reshape(len(at), size)
        rows = [
            self.rows[layout.places["input", name, end]]
            if ("input", name, end) in layout.places
            else self._read[name, end]
            for end in of.inputs
        ]
        inputs = np.array(rows).reshape(len(rows), size)
        outputs = of.C @ states + of.D @ inputs
        self.rows[at] = of.A @ states + of.B @ inputs
        return dict(zip(of.outputs, outputs))
