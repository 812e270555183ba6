"""Runs of single FMUs that use all of their internal state, for comparing runs bit by bit."""

import math
from dataclasses import dataclass

from tests.extent import sample
from tests.fmus.expected import MEASUREMENT
from tests.fmus.instance import Instance

Values = dict[str, float | bool]

STEPS = 25
"""Of a whole flight."""


@dataclass(frozen=True)
class Flight:
    """An FMU alone, its start values, its step and whether it flies on reference inputs."""

    model: str
    start: Values
    h: float

    def inputs(self, k: int) -> Values:
        """What is set before step `k`."""
        swing = math.sin(0.7 * k)
        if self.model == "QuadrotorPlant":
            return {
                "thrust": 9.81 + swing,
                "torque.x": 0.2 * swing,
                "torque.z": 0.1 - 0.05 * swing,
                "external_force.y": 0.3 * swing,
            }
        moved = {name: value + 0.1 * swing for name, value in MEASUREMENT.items()}
        return {**moved, "reference.position.x": 0.01 * k, "reference.velocity.x": 0.2}

    def begin(self, instance: Instance) -> None:
        """Through initialisation."""
        instance.initialise({**self.inputs(0), **self.start})

    def fly(self, instance: Instance, first: int, last: int) -> list[list[str]]:
        """Steps `first` to `last - 1`; every variable after each of them, to the last bit."""
        rows = []
        for k in range(first, last):
            instance.set(self.inputs(k))
            instance.step(k * self.h, self.h)
            rows.append(instance.everything())
        return rows


_ALL = {
    "plant": Flight("QuadrotorPlant", {"mass": 1.3, "initial.angular_velocity.y": 0.4}, 0.01),
    # A payload that is let go inside of a step, which has internal steps of other lengths before it than after it.
    "plant with payload": Flight("QuadrotorPlant", {"payload.mass": 0.4, "payload.drop_time": 0.1037}, 0.01),
    # A lag: the actuators are a state that no variable shows. Wind: the plant depends on time.
    "plant with lag and wind": Flight(
        "QuadrotorPlant",
        {"actuator_time_constant": 0.05, "wind.amplitude.x": 2.0, "wind.frequency": 3.0, "inertia.xy": 0.1},
        0.007,
    ),
    # Other axes: what the plant shows of its attitude is rounded, and its own is not.
    "plant in other axes": Flight("QuadrotorPlant", {"frame": 2, "initial.angular_velocity.y": 0.4}, 0.01),
    "controller": Flight("UnifiedController", {"gain.eta": 12.0}, 0.01),
    # Commands on their way: those of three steps, under which the model runs ahead.
    "controller that predicts": Flight(
        "UnifiedController", {"prediction": 0.03, "discretisation": 4, "sample_period": 0.0, "stages": 2}, 0.01
    ),
    # 4 ms steps on a 10 ms clock: at most communication points the next sample is still to come.
    "controller between samples": Flight(
        "UnifiedController", {"sample_offset": 0.002, "use_reference_inputs": True, "mass": 1.2}, 0.004
    ),
    # Motors: four thrusts that no variable shows, some of them at their limits, some on their way up and some down.
    "plant with motors": Flight(
        "QuadrotorPlant",
        {
            "motor.thrust_max": 2.5,
            "motor.arm.x": 0.1,
            "motor.arm.y": 0.08,
            "motor.drag_to_thrust": 0.2,
            "motor.time_constant.up": 0.02,
            "motor.time_constant.down": 0.05,
        },
        0.01,
    ),
}
FLIGHTS = {name: _ALL[name] for name in sample([*_ALL], 4)}
"""By name; all together use every kind of state that the FMUs have."""
