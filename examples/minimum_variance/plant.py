"""An integrator that noise drives, solved exactly over each step."""

from fmu_kit.slave import Slave
from fmu_kit.variables import continuous_input, continuous_output, fixed_parameter


class Integrator(Slave):
    """x' = u + w, both held over a step."""

    variables = (
        continuous_input("u", "command", "1/s"),
        continuous_input("w", "noise", "1/s"),
        continuous_output("x", "state", "1"),
        fixed_parameter("initial.x", "x(0)", "1", 0.0),
    )
    description = "Integrator: command and noise in, state out"
    initial_outputs_depend_on_inputs = False

    def initialise(self, t: float) -> None:
        """Start at the initial state."""
        self.put("x", self.real("initial.x"))

    def step(self, t: float, h: float) -> None:
        """Advance exactly."""
        self.put("x", self.real("x") + h * (self.real("u") + self.real("w")))
