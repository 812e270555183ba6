"""A DC servo, solved exactly over each step."""

import math

from fmu_kit.slave import Slave
from fmu_kit.variables import continuous_input, continuous_output, fixed_parameter


class Servo(Slave):
    """1000/(s (s + 1)): angle' = speed, speed' = (gain · u - speed) / time_constant, with u held over a step."""

    variables = (
        continuous_input("u", "command", "V"),
        continuous_output("angle", "of the shaft", "rad"),
        continuous_output("speed", "of the shaft", "rad/s"),
        fixed_parameter("gain", "speed per command at rest", "rad/(s.V)", 1000.0),
        fixed_parameter("time_constant", "of the speed", "s", 1.0, above=0.0),
        fixed_parameter("initial.angle", "angle(0)", "rad", 1.0),
        fixed_parameter("initial.speed", "speed(0)", "rad/s", 0.0),
    )
    description = "DC servo: command in, angle and speed out"
    initial_outputs_depend_on_inputs = False

    def initialise(self, t: float) -> None:
        """Start at the initial state."""
        self.put("angle", self.real("initial.angle"))
        self.put("speed", self.real("initial.speed"))

    def step(self, t: float, h: float) -> None:
        """Advance by the exponential of the system matrix, which is triangular, over `h`."""
        time_constant, speed = self.real("time_constant"), self.real("speed")
        final = self.real("gain") * self.real("u")
        left = -math.expm1(-h / time_constant)  # 1 - exp(-h / time_constant)
        self.put("angle", self.real("angle") + final * h + (speed - final) * time_constant * left)
        self.put("speed", speed + (final - speed) * left)
