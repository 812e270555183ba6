"""A PD controller that differentiates by the sample before."""

from fmu_kit.interface import Input, Local, Output, Parameter
from fmu_kit.slave import Slave


class PdController(Slave):
    """PD controller: angle in, command out; u = -K (y + Td/h (y - y of the sample before))."""

    angle = Input("measured", "rad")
    u = Output("command", "V")
    last_angle = Local("at the sample before", "rad")
    K = Parameter("gain", "V/rad", 1.5)
    Td = Parameter("derivative time", "s", 0.035, minimum=0.0)
    period = Parameter("h for which the controller is programmed", "s", 0.006, above=0.0)

    initial_outputs_depend_on_inputs = False

    def initialise(self, t: float) -> None:
        """At rest until the first sample."""
        self.last_angle = self.angle

    def step(self, t: float, h: float) -> None:
        """The command, and what the next one needs."""
        angle = self.angle
        self.u = -self.K * (angle + self.Td / self.period * (angle - self.last_angle))
        self.last_angle = angle
