"""A loop about its operating point: the matrices of its components, and the quantities that vary from draw to draw."""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction

from orchestration.foundation.basics.errors import UsageError
from orchestration.foundation.basics.times import NANOSECONDS
from orchestration.foundation.processes.passable import passable
from orchestration.systems.system.connection import Connection, variable_of
from orchestration.systems.system.model import System
from orchestration.theory.stability.lifted_component import of_one_rate, several_rates
from orchestration.theory.stability.loop_at_rest import AtRest
from orchestration.theory.stability.matrices import (
    Components,
    SampledSystem,
    depends_on_step,
    in_continuous_time,
    in_output_coordinates,
    of_samples,
)


@passable
@dataclass(frozen=True, kw_only=True)
class CertifiedLoop:
    """A system about its operating point, as matrices."""

    system: System
    components: Components
    period: Fraction
    """the hyperperiod [ns]"""

    def connection(self, name: str) -> Connection:
        """The connection of a name."""
        return next(x for x in self.system.connections if x.name == name)

    def is_sampled(self, name: str) -> bool:
        """Whether a component is a digital task."""
        return isinstance(self.components[name], SampledSystem)

    def depends_on_step(self, name: str) -> bool:
        """Whether the samples of a component depend on the time to the next one."""
        part = self.components[name]
        return isinstance(part, SampledSystem) and part.depends_on_step


def certified_loop(rest: AtRest) -> CertifiedLoop:
    """The loop of a system at rest; raises `UsageError` for an unsupported one."""
    from scipy.linalg import expm  # comes with an extra

    system = rest.simulation.system
    for x in system.connections:
        if x.hold != "zero":
            raise UsageError(f"connections.{x.name}.hold: expected zero")
        if system.components[x.sender].sampling is None and system.components[x.receiver].sampling is None:
            raise UsageError(f"connections.{x.name}: expected a sampled component at one of its ends")
    for name, component in system.components.items():
        if component.sampling is not None and (count := rest.samples(name)) > 1:
            raise several_rates(name, count)  # before any is measured, which takes long
    period = float(rest.period) / NANOSECONDS
    components: Components = {}
    for name, component in system.components.items():
        tangent = of_one_rate(rest.tangents[name])
        if component.sampling is not None:
            found = of_samples(tangent, component.sampling.period)
            varies = rest.simulation.instances[name].model.varies_step
            components[name] = SampledSystem(
                **vars(in_output_coordinates(found, found.A)),
                depends_on_step=not varies or depends_on_step(tangent, component.sampling.period),
            )
        else:
            assert component.step is not None
            matrices = in_continuous_time(tangent, min(component.step, period))
            if matrices.unfit is not None:
                raise UsageError(
                    f"{name}: {matrices.unfit}, so it is no linear system in continuous time, or rounding hides that "
                    "it is: expected another step, or a component that integrates more accurately, as by more "
                    "internal steps or a higher order"
                )
            components[name] = in_output_coordinates(matrices, expm(matrices.A * period))
    for x in system.connections:
        for start, end in zip(x.start, x.end):
            known = (components[x.sender].outputs, components[x.receiver].inputs)
            if variable_of(start) not in known[0] or variable_of(end) not in known[1]:
                raise UsageError(f"connections.{x.name}: carries {start}, which is no Real")
    return CertifiedLoop(system=system, components=components, period=rest.period)


JITTER, DELAY, LOSS = "jitter", "delay_jitter", "loss"
SHIFT, LATENCY = "shift", "latency"
BOXES = 6
"""Boxes that cover two quantities with a limited sum"""

Point = tuple[int, ...]
"""A value of each quantity"""


@dataclass(frozen=True)
class Varying:
    """A quantity that varies from draw to draw."""

    kind: str
    """`jitter` of a sampled component, which delays its messages, or its `shift`, which does not; the `latency` of all
    that it sends; `delay_jitter` or `loss` of a connection"""
    name: str
    """Name of the component or connection"""
    path: str


@dataclass(frozen=True)
class Draws:
    """The range of one draw: each quantity from 0 to its largest value, the sum of two at most `largest_sum`."""

    largest: Sequence[int]
    largest_sum: int

    def corners(self) -> list[Point]:
        """Points whose convex hull contains all draws."""
        if len(self.largest) < 2:
            return [*itertools.product(*((0, J) for J in self.largest))]
        bend = min(max(self.largest_sum - self.largest[1], 0), self.largest[0])
        return [(x, y) for x in (0, bend, self.largest[0]) for y in (0, self._largest_second(x))]

    def _largest_second(self, first: int) -> int:
        """The largest value of the second quantity for one of the first."""
        return min(self.largest[1], self.largest_sum - first)
