"""A sensor with a digital low-pass filter."""

import math

from fmu_kit.slave import Slave
from fmu_kit.variables import continuous_input, discrete_output, fixed_parameter


class SpeedSensor(Slave):
    """filtered' = (speed - filtered) / time_constant, a step at a time."""

    variables = (
        continuous_input("speed", "measured", "m/s"),
        discrete_output("filtered", "speed", "m/s"),
        fixed_parameter("time_constant", "of the filter", "s", 0.05, above=0.0),
    )
    description = "Speed sensor: speed in, filtered speed out"

    def initialise(self, t: float) -> None:
        """Start at what is measured."""
        self.put("filtered", self.real("speed"))

    def step(self, t: float, h: float) -> None:
        """Filter; `h` is the time until the next sample."""
        share = -math.expm1(-h / self.real("time_constant"))
        self.put("filtered", self.real("filtered") + share * (self.real("speed") - self.real("filtered")))
