"""What the tests of `quadcosim ssp` and `quadcosim interop` share: other parameters, agreements, flights."""

from collections.abc import Sequence

import numpy as np

from orchestration.foundation.basics.simulator import Floats
from orchestration.quadrotor.scenarios.wiring import COMMAND, MEASUREMENT
from orchestration.simulation.interop.assignment import AssignedLoop, Ports
from orchestration.simulation.interop.catalogue import TOOLS, Tool
from orchestration.simulation.interop.compare import Agreement
from orchestration.simulation.interop.trace import Trace
from quadcosim import Scenario, run

PORTS = {
    "controller": Ports(inputs=MEASUREMENT, outputs=COMMAND),
    "plant": Ports(inputs=COMMAND, outputs=MEASUREMENT),
}
LOOP = AssignedLoop(
    ports=PORTS,
    connections=(
        *((("plant", name), ("controller", name)) for name in MEASUREMENT),
        *((("controller", name), ("plant", name)) for name in COMMAND),
    ),
    kinds={(name, v): "Real" for name, ports in PORTS.items() for v in ports.inputs + ports.outputs},
    states=tuple(f"plant.{name}" for name in MEASUREMENT),
    commands=tuple(f"controller.{name}" for name in COMMAND),
)
"""The quadrotor's."""


def components_of(tool: Tool) -> tuple[str, ...]:
    """The components that a tool runs."""
    return tuple(PORTS) if tool.alone is None else (tool.alone,)


OTHER = {
    "plant.mass": 1.2,
    "plant.inertia.xx": 1.1,
    "plant.inertia.xy": 0.05,
    "plant.inertia.xz": -0.03,
    "plant.inertia.yz": 0.02,
    "plant.initial.position.x": 1.5,
    "plant.initial.velocity.y": -0.2,
    "plant.external_force.x": 0.1,
    "controller.mass": 1.2,
    "controller.inertia.xy": 0.05,
    "controller.gain.eta": 10.0,
}
"""Parameters, and an input that nothing is connected to, all away from their defaults."""


def with_other_parameters(scenario: Scenario) -> Scenario:
    return scenario.with_changes(parameters=OTHER, timing={"period": 0.02})


def states_of_master(scenario: Scenario) -> Floats:
    """The states of the plant in a run of this project's master, shape (n, 13)."""
    signals = run(scenario.with_changes(timing={"clock": "fmu"})).signals
    return np.column_stack([signals[name] for name in LOOP.states])


def farthest(agreement: Agreement, differences: dict[str, float]) -> float:
    """The largest difference of a state, of a command if no plant was run."""
    kind = "plant." if "plant" in components_of(agreement.tool) else "controller."
    values = [value for name, value in differences.items() if name.startswith(kind)]
    assert len(values) == (13 if kind == "plant." else 4)
    return max(values)


def agreement(
    tool: str = "libcosim",
    same_first_inputs: float = 1e-12,
    as_it_comes: float = 1e-3,
    first: Sequence[str] = ("exchanged",) * 2,
) -> Agreement:
    """An agreement without runs: every signal of the tool has this difference from this project's."""
    chosen = TOOLS[tool]
    names = [name for name in LOOP.signals if name.partition(".")[0] in components_of(chosen)]
    inputs: dict[str, tuple[float, ...]] = dict.fromkeys(components_of(chosen), (0.0,))
    return Agreement(
        tool=chosen,
        versions=dict.fromkeys(chosen.packages, "1.0"),
        trace=Trace(
            order="jacobi",
            initial_inputs=inputs,
            first_inputs=inputs,
            first_exchange=dict(zip(components_of(chosen), first)),
            steps=3000,
            drift=2e-12,
            end=30.0,
        ),
        as_it_comes=dict.fromkeys(names, as_it_comes),
        same_first_inputs=dict.fromkeys(names, same_first_inputs),
        states=frozenset(LOOP.states),
    )
