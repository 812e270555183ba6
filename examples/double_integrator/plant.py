"""A double integrator, solved exactly over each step."""

from fmu_kit.slave import Slave
from fmu_kit.variables import continuous_input, continuous_output, fixed_parameter


class DoubleIntegrator(Slave):
    """x'' = u, with u held over a step."""

    variables = (
        continuous_input("u", "acceleration", "m/s2"),
        continuous_output("x", "position", "m"),
        continuous_output("v", "velocity", "m/s"),
        fixed_parameter("initial.x", "x(0)", "m", 1.0),
        fixed_parameter("initial.v", "v(0)", "m/s", 0.0),
    )
    description = "Double integrator: acceleration in, position and velocity out"
    initial_outputs_depend_on_inputs = False

    def initialise(self, t: float) -> None:
        """Start at the initial state."""
        self.put("x", self.real("initial.x"))
        self.put("v", self.real("initial.v"))

    def step(self, t: float, h: float) -> None:
        """Advance exactly."""
        x, v, u = self.real("x"), self.real("v"), self.real("u")
        self.put("x", x + h * v + 0.5 * h * h * u)
        self.put("v", v + h * u)
