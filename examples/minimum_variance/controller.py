"""Proportional feedback."""

from fmu_kit.interface import Input, Output, Parameter
from fmu_kit.slave import Slave


class Feedback(Slave):
    """Proportional feedback: state in, command out."""

    x = Input("measured state", "1")
    u = Output("command", "1/s")
    gain = Parameter("gain of the feedback; 3 - sqrt(3) is best for x^2 at a period of 1 s", "1/s", 3 - 3**0.5)

    def initialise(self, t: float) -> None:
        """The command for the initial state."""
        self.step(t, 0.0)

    def step(self, t: float, h: float) -> None:
        """The command for the measured state."""
        self.u = -self.gain * self.x
