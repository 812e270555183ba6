"""The rest of unstable loops from one near by, with stubs whose equations are solved by hand."""

import math
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from orchestration.foundation.basics.simulator import Floats, Transfer
from orchestration.systems.system.connection import Connection
from orchestration.theory.stability.equilibrium import Steady, balance
from orchestration.theory.stability.excitation import Rest
from orchestration.theory.stability.identification import of_samples
from orchestration.theory.stability.lifted_component import LiftedTangent

LEVEL = (0.5 * math.sqrt(0.025**2 + 4.0) - 0.0125) ** 2
"""where 40 (1 - level) is its root"""


class Stub:
    """A stub of an FMU with one input and one output, and a state."""

    def __init__(self, x: float, u: float, y: float) -> None:
        self.model = SimpleNamespace(path="Stub.fmu")
        self.name, self.values = "stub", [x, u, y, 0.0]

    def writer(self, names: Any, source: Floats) -> Transfer:
        def write() -> None:
            self.values[1] = float(source[0])

        return write

    def reader(self, names: Any, into: Floats) -> Transfer:
        def read() -> None:
            into[0] = self.values[2]

        return read

    def save(self) -> bytes:
        return np.array(self.values).tobytes()

    def restore(self, state: bytes) -> None:
        self.values = np.frombuffer(state).tolist()


class Tank(Stub):
    """Its outflow is the root of its level."""

    def step(self, t: float, h: float) -> None:
        level = self.values[0] + h * (self.values[1] - math.sqrt(self.values[0]))
        self.values[0] = self.values[2] = level


class Law(Stub):
    """A gain, beside which there may be an integral of every n-th sample, of the error to a level of 1."""

    def __init__(self, gain: float, integral: float, every: int, *values: float) -> None:
        super().__init__(*values)
        self.gain, self.integral, self.every = gain, integral, every

    def step(self, t: float, h: float) -> None:
        error, self.values[3] = 1.0 - self.values[1], self.values[3] + 1
        if self.values[3] % self.every == 0:
            self.values[0] += h * error
        self.values[2] = self.gain * error + self.integral * self.values[0]


@pytest.mark.parametrize(
    ("law", "level", "scale"),
    [
        (Law(40.0, 0.0, 1, 0.0, 0.81, 0.9), LEVEL, 1.0),
        (Law(2.0, 80.0, 1, 0.1, 1.0, 8.0), 1.0, 1.0),
        (Law(2.0, 10.0, 1, 0.1, 1.0, 1.0), 1.0, -0.5),
        (Law(2.0, 80.0, 3, 0.1, 1.0, 8.0), 1.0, 1.0),
    ],
)
def test_components_are_led_to_where_each_stays_at_the_outputs_of_the_others(
    law: Law, level: float, scale: float
) -> None:
    """From the rest of other gains; in the first case the level changes, with an outflow that is not linear."""
    tank = Tank(law.values[1], math.sqrt(law.values[1]), law.values[1])
    components = list[Steady]()
    for name, fmu in {"tank": tank, "law": law}.items():
        rest = Rest(fmu=cast(Any, fmu), inputs=("u",), held=np.array(fmu.values[1:2]), outputs=("y",), time=0.0)
        found = of_samples(rest, 0.1).tangent()
        assert isinstance(found, LiftedTangent) == (name == "law" and law.every > 1)
        components.append(Steady(name, found, {"u": fmu.values[1]}))
    wires = (
        Connection(name="measurement", start=("tank.y",), end=("law.u",)),
        Connection(name="command", start=("law.y",), end=("tank.u",), scale=scale, stated=True),
    )
    balance(components, wires)
    for one, stub in zip(components, (tank, law)):
        stub.restore(one.state.saved)
        stub.values[1] = float(one.held[0])
    for _ in range(6):
        tank.step(0.0, 0.1)
        law.step(0.0, 0.1)
        assert tank.values[2] == pytest.approx(law.values[1], abs=1e-11)
        assert scale * law.values[2] == pytest.approx(tank.values[1], abs=1e-11)
    assert tank.values[0] == pytest.approx(level, abs=1e-11)
