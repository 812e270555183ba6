"""An LQG controller: a Kalman filter that knows the plant, the command and its delay, and a gain."""

import math

from fmu_kit.interface import Input, Local, Output, Parameter
from fmu_kit.slave import Slave


class LqgController(Slave):
    """LQG controller of an inverted pendulum: measured angle in, command and estimates out.

    What is between samples is predicted from the last two commands, of which the later one arrives `delay` after its
    sample; a new measurement corrects it, and the command is a gain of the estimate and of the command before.
    The gains are best for the parameters as they are, and the weights and noises of system.toml: design.py.
    """

    y = Input("measured angle", "rad")
    u = Output("command", "rad")
    angle = Output("estimated angle", "rad")
    rate = Output("estimated rate", "rad/s")
    last_u = Local("command before the last one", "rad")
    k_angle = Parameter("gain of the angle", "1", 3.13789517792)
    k_rate = Parameter("gain of the rate", "s", 0.795214790285)
    k_u = Parameter("gain of the command before", "1", 0.0)
    l_angle = Parameter("correction of the angle by the measurement", "1", 0.599549261969)
    l_rate = Parameter("correction of the rate by the measurement", "1/s", 2.69065814218)
    omega = Parameter("natural frequency of the pendulum", "1/s", 3.0, above=0.0)
    period = Parameter("h for which the controller is programmed", "s", 0.1, above=0.0)
    delay = Parameter("delay of its commands, up to h, for which it is programmed", "s", 0.0, minimum=0.0)

    initial_outputs_depend_on_inputs = False

    def initialise(self, t: float) -> None:
        """The estimate is upright and at rest."""

    def step(self, t: float, h: float) -> None:
        """Sample: predict, correct, command."""
        angle, rate = self._held(self.angle, self.rate, self.last_u, self.delay)
        angle, rate = self._held(angle, rate, self.u, self.period - self.delay)
        innovation = self.y - angle
        self.angle = angle + self.l_angle * innovation
        self.rate = rate + self.l_rate * innovation
        self.last_u = self.u
        self.u = self.k_angle * self.angle + self.k_rate * self.rate + self.k_u * self.last_u

    def _held(self, angle: float, rate: float, u: float, time: float) -> tuple[float, float]:
        """Angle and rate `time` later, under a held command."""
        omega = self.omega
        growing = 0.5 * (angle - u + rate / omega) * math.exp(omega * time)
        decaying = 0.5 * (angle - u - rate / omega) * math.exp(-omega * time)
        return u + growing + decaying, omega * (growing - decaying)
