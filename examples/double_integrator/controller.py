"""State feedback."""

from fmu_kit.interface import Input, Output, Parameter
from fmu_kit.slave import Slave


class StateFeedback(Slave):
    """State feedback: position and velocity in, acceleration out."""

    x = Input("position", "m")
    v = Input("velocity", "m/s")
    u = Output("acceleration", "m/s2")
    k_p = Parameter("gain of the position", "1/s2", 1.0)
    k_d = Parameter("gain of the velocity", "1/s", 1.0)

    def initialise(self, t: float) -> None:
        """The command for the initial state."""
        self.step(t, 0.0)

    def step(self, t: float, h: float) -> None:
        """The command for the measured state."""
        self.u = -self.k_p * self.x - self.k_d * self.v
