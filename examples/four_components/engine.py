"""An engine with a limited rate of change."""

from fmu_kit.interface import Input, Parameter, State
from fmu_kit.slave import Slave


class Engine(Slave):
    """Engine: force asked in, force out.

    The force moves to what is asked, no faster than `rate_max`.
    """

    asked = Input("force asked of it", "N")
    force = State("force at the wheels", "N", 800.0, variability="discrete")
    rate_max = Parameter("largest change of the force", "N/s", 5000.0, above=0.0)

    def step(self, t: float, h: float) -> None:
        """Sample; `h` is the time until the next one."""
        most = self.rate_max * h
        self.force = self.force + min(max(self.asked - self.force, -most), most)
