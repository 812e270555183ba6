"""An inverted pendulum about upright, driven by a disturbance, solved exactly over each step."""

import math

from fmu_kit.interface import Input, Parameter, State
from fmu_kit.slave import Slave


class Pendulum(Slave):
    """Inverted pendulum about upright: command and disturbance in, angle and rate out.

    angle'' = omega^2 (angle - u) + w, with u and w held over a step.
    """

    u = Input("command: the angle at which it is in balance with the weight", "rad")
    w = Input("disturbance", "rad/s2")
    angle = State("angle from upright", "rad")
    rate = State("rate of the angle", "rad/s")
    omega = Parameter("rate at which it falls: sqrt(gravity / length)", "1/s", 3.0, above=0.0)

    def step(self, t: float, h: float) -> None:
        """Advance by the growing and the decaying mode, about the equilibrium angle under u and w."""
        omega = self.omega
        balanced = self.u - self.w / (omega * omega)
        off = self.angle - balanced
        growing = 0.5 * (off + self.rate / omega) * math.exp(omega * h)
        decaying = 0.5 * (off - self.rate / omega) * math.exp(-omega * h)
        self.angle = balanced + growing + decaying
        self.rate = omega * (growing - decaying)
