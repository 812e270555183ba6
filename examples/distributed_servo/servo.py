"""A DC servo with a disturbance at its input, solved exactly over each step."""

import math

from fmu_kit.interface import Input, Parameter, State
from fmu_kit.slave import Slave


class DrivenServo(Slave):
    """DC servo: command and disturbance in, angle and speed out.

    1000/(s (s + 1)): angle' = speed, speed' = gain · (u + w) - speed, with u and w held over a step.
    Nothing has a unit: the cost adds up squares of the angle and of the command.
    """

    u = Input("command", None)
    w = Input("disturbance at the input", None)
    angle = State("angle of the shaft", None)
    speed = State("speed of the shaft", None)
    gain = Parameter("speed per command at rest", None, 1000.0)

    def step(self, t: float, h: float) -> None:
        """Advance by the exponential of the system matrix, which is triangular, over `h`."""
        speed, final = self.speed, self.gain * (self.u + self.w)
        left = -math.expm1(-h)  # 1 - exp(-h)
        self.angle = self.angle + final * h + (speed - final) * left
        self.speed = speed + (final - speed) * left
