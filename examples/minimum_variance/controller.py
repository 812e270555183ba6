"""Proportional feedback."""

from fmu_kit.slave import Slave
from fmu_kit.variables import continuous_input, discrete_output, tunable_parameter


class Feedback(Slave):
    """u = -gain · x."""

    variables = (
        continuous_input("x", "measured state", "1"),
        discrete_output("u", "command", "1/s"),
        tunable_parameter("gain", "of the feedback; 3 - sqrt(3) is best for x^2 at a period of 1 s", "1/s", 3 - 3**0.5),
    )
    description = "Proportional feedback: state in, command out"

    def initialise(self, t: float) -> None:
        """The command for the initial state."""
        self.step(t, 0.0)

    def step(self, t: float, h: float) -> None:
        """The command for the state that was measured."""
        self.put("u", -self.real("gain") * self.real("x"))
