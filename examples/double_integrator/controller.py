"""State feedback."""

from fmu_kit.saved_state import State
from fmu_kit.slave import Slave
from fmu_kit.variables import continuous_input, discrete_output, tunable_parameter


class StateFeedback(Slave):
    """u = -k_p x - k_d v."""

    variables = (
        continuous_input("x", "position", "m"),
        continuous_input("v", "velocity", "m/s"),
        discrete_output("u", "acceleration", "m/s2"),
        tunable_parameter("k_p", "gain of the position", None, 1.0),
        tunable_parameter("k_d", "gain of the velocity", None, 1.0),
    )
    description = "State feedback: position and velocity in, acceleration out"
    initial_outputs_depend_on_inputs = True

    def read_parameters(self) -> None:
        """There is nothing to prepare."""

    def initialise(self, t: float) -> None:
        """The command of the initial state."""
        self._command()

    def step(self, t: float, h: float) -> None:
        """The command of the state that was measured."""
        self._command()

    def internal_state(self) -> State:
        """The command is among the variables."""
        return {}

    def restore(self, state: State) -> None:
        """Nothing beyond the variables."""

    def _command(self) -> None:
        self.put("u", -self.real("k_p") * self.real("x") - self.real("k_d") * self.real("v"))
