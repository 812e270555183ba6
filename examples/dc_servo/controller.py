"""A discrete PID controller."""

from fmu_kit.interface import Input, Local, Output, Parameter
from fmu_kit.slave import Slave


class PidController(Slave):
    """PID controller: angle in, command out.

    Integral by forward Euler, derivative of the output by backward difference with a filter.
    """

    angle = Input("measured angle", "rad")
    reference = Input("desired angle", "rad")
    u = Output("command", "V")
    integral = Local("part of the command, after the last sample", "V")
    derivative = Local("part of the command at the last sample", "V")
    last_angle = Local("angle at the last sample", "rad")
    K = Parameter("gain", "V/rad", 0.96)
    Ti = Parameter("integral time", "s", 0.12, above=0.0)
    Td = Parameter("derivative time", "s", 0.049, minimum=0.0)
    N = Parameter("largest gain of the derivative, over K", "1", 10.0, above=0.0)
    period = Parameter("h for which the controller is programmed", "s", 0.006, above=0.0)

    initial_outputs_depend_on_inputs = False

    def initialise(self, t: float) -> None:
        """The controller is at rest until the first sample."""
        self.last_angle = self.angle

    def step(self, t: float, h: float) -> None:
        """Sample: the command first, then the state for the next sample."""
        K, Td, N, period = self.K, self.Td, self.N, self.period
        angle, error = self.angle, self.reference - self.angle
        self.derivative = (Td * self.derivative - K * Td * N * (angle - self.last_angle)) / (Td + N * period)
        self.u = K * error + self.integral + self.derivative
        self.integral = self.integral + K * period / self.Ti * error
        self.last_angle = angle
