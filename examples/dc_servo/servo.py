"""A DC servo, solved exactly over each step."""

import math

from fmu_kit.interface import Input, Parameter, State
from fmu_kit.slave import Slave


class Servo(Slave):
    """DC servo: command in, angle and speed out.

    1000/(s (s + 1)): angle' = speed, speed' = (gain · u - speed) / time_constant, with u held over a step.
    """

    u = Input("command", "V")
    angle = State("angle of the shaft", "rad", 1.0)
    speed = State("speed of the shaft", "rad/s")
    gain = Parameter("speed per command at rest", "rad/(s.V)", 1000.0)
    time_constant = Parameter("time constant of the speed", "s", 1.0, above=0.0)

    def step(self, t: float, h: float) -> None:
        """Advance by the exponential of the system matrix, which is triangular, over `h`."""
        time_constant, speed = self.time_constant, self.speed
        final = self.gain * self.u
        left = -math.expm1(-h / time_constant)  # 1 - exp(-h / time_constant)
        self.angle = self.angle + final * h + (speed - final) * time_constant * left
        self.speed = speed + (final - speed) * left
