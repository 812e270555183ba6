"""A discrete PD controller."""

from fmu_kit.interface import Input, Local, Output, Parameter
from fmu_kit.slave import Slave


class PdController(Slave):
    """PD controller: angle in, command out; the derivative of the angle by backward difference."""

    angle = Input("measured angle", "rad")
    u = Output("command", "V")
    last_angle = Local("angle at the last sample", "rad")
    K = Parameter("gain", "V/rad", 1.5)
    Td = Parameter("derivative time", "s", 0.035, minimum=0.0)
    period = Parameter("h for which the controller is programmed", "s", 0.006, above=0.0)

    initial_outputs_depend_on_inputs = False

    def initialise(self, t: float) -> None:
        """The controller is at rest until the first sample."""
        self.last_angle = self.angle

    def step(self, t: float, h: float) -> None:
        """Sample."""
        angle = self.angle
        self.u = -self.K * (angle + self.Td / self.period * (angle - self.last_angle))
        self.last_angle = angle
