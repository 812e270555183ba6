"""A switch with hysteresis."""

from fmu_kit.interface import Input, Output, Parameter
from fmu_kit.slave import Slave


class TankController(Slave):
    """Water tank controller: level in, valve out.

    Opens the valve from `maxlevel` on, closes it from `minlevel` down, and leaves it in between.
    """

    level = Input("measured level", "m")
    maxlevel = Parameter("level from which the valve is opened", "m", 2.0)
    minlevel = Parameter("level at which the valve is closed", "m", 1.0)
    valve = Output("whether the valve is to be open", start=False)

    def initialise(self, t: float) -> None:
        """The command for the initial level; the valve is closed between the two levels."""
        self.valve = False
        self.step(t, 0.0)

    def step(self, t: float, h: float) -> None:
        """Compare."""
        if self.level >= self.maxlevel:
            self.valve = True
        elif self.level <= self.minlevel:
            self.valve = False
