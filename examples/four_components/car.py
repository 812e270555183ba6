"""A car on a road, solved exactly over each step."""

import math

from fmu_kit.interface import Input, Parameter, State
from fmu_kit.slave import Slave


class Car(Slave):
    """Car: forces in, speed out.

    mass · speed' = force + slope - drag · speed, with both forces held over a step.
    """

    force = Input("force of the engine at the wheels", "N")
    slope = Input("force of the road's slope, negative uphill", "N")
    speed = State("speed of the car", "m/s", 20.0)
    mass = Parameter("mass of the car", "kg", 1200.0, above=0.0)
    drag = Parameter("drag per speed", "N.s/m", 40.0, above=0.0)

    def step(self, t: float, h: float) -> None:
        """Advance exactly."""
        drag, speed = self.drag, self.speed
        final = (self.force + self.slope) / drag
        self.speed = speed - (final - speed) * math.expm1(-h * drag / self.mass)
