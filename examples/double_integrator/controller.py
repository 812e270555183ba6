"""State feedback."""

from fmu_kit.slave import Slave
from fmu_kit.variables import continuous_input, discrete_output, tunable_parameter


class StateFeedback(Slave):
    """u = -k_p x - k_d v."""

    variables = (
        continuous_input("x", "position", "m"),
        continuous_input("v", "velocity", "m/s"),
        discrete_output("u", "acceleration", "m/s2"),
        tunable_parameter("k_p", "gain of the position", "1/s2", 1.0),
        tunable_parameter("k_d", "gain of the velocity", "1/s", 1.0),
    )
    description = "State feedback: position and velocity in, acceleration out"

    def initialise(self, t: float) -> None:
        """The command for the initial state."""
        self.step(t, 0.0)

    def step(self, t: float, h: float) -> None:
        """The command for the state that was measured."""
        self.put("u", -self.real("k_p") * self.real("x") - self.real("k_d") * self.real("v"))
