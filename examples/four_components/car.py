"""A car on a road, solved exactly over each step."""

import math

from fmu_kit.slave import Slave
from fmu_kit.variables import continuous_input, continuous_output, fixed_parameter


class Car(Slave):
    """mass · speed' = force + slope - drag · speed, with both forces held over a step."""

    variables = (
        continuous_input("force", "of the engine at the wheels", "N"),
        continuous_input("slope", "force of the road's slope, negative uphill", "N"),
        continuous_output("speed", "of the car", "m/s"),
        fixed_parameter("mass", "of the car", "kg", 1200.0, above=0.0),
        fixed_parameter("drag", "per speed", "N.s/m", 40.0, above=0.0),
        fixed_parameter("initial.speed", "speed(0)", "m/s", 20.0),
    )
    description = "Car: forces in, speed out"
    initial_outputs_depend_on_inputs = False

    def initialise(self, t: float) -> None:
        """Start at the initial speed."""
        self.put("speed", self.real("initial.speed"))

    def step(self, t: float, h: float) -> None:
        """Advance exactly."""
        drag, speed = self.real("drag"), self.real("speed")
        final = (self.real("force") + self.real("slope")) / drag
        self.put("speed", speed - (final - speed) * math.expm1(-h * drag / self.real("mass")))
