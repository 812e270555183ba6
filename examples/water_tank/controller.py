"""A switch with hysteresis."""

from fmu_kit.slave import Slave
from fmu_kit.variables import continuous_input, discrete_output, fixed_parameter


class TankController(Slave):
    """Opens the valve from `maxlevel` on, closes it from `minlevel` down, and leaves it in between."""

    variables = (
        continuous_input("level", "measured", "m"),
        fixed_parameter("maxlevel", "from which the valve is opened", "m", 2.0),
        fixed_parameter("minlevel", "at which it is closed", "m", 1.0),
        discrete_output("valve", "whether the valve is to be open", None, False),
    )
    description = "Water tank controller: level in, valve out"

    def initialise(self, t: float) -> None:
        """The command for the initial level; between the two the valve is closed."""
        self.put_boolean("valve", False)
        self.step(t, 0.0)

    def step(self, t: float, h: float) -> None:
        """Compare."""
        level = self.real("level")
        if level >= self.real("maxlevel"):
            self.put_boolean("valve", True)
        elif level <= self.real("minlevel"):
            self.put_boolean("valve", False)
