"""A sensor with a digital low-pass filter."""

import math

from fmu_kit.interface import Input, Output, Parameter
from fmu_kit.slave import Slave


class SpeedSensor(Slave):
    """Speed sensor: speed in, filtered speed out.

    filtered' = (speed - filtered) / time_constant, a step at a time.
    """

    speed = Input("measured speed", "m/s")
    filtered = Output("filtered speed", "m/s")
    time_constant = Parameter("time constant of the filter", "s", 0.05, above=0.0)

    def initialise(self, t: float) -> None:
        """Start at the measured speed."""
        self.filtered = self.speed

    def step(self, t: float, h: float) -> None:
        """Filter; `h` is the time until the next sample."""
        share = -math.expm1(-h / self.time_constant)
        self.filtered = self.filtered + share * (self.speed - self.filtered)
