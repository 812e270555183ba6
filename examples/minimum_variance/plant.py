"""An integrator driven by noise, solved exactly over each step."""

from fmu_kit.interface import Input, State
from fmu_kit.slave import Slave


class Integrator(Slave):
    """Integrator: command and noise in, state out."""

    u = Input("command", "1/s")
    w = Input("noise", "1/s")
    x = State("state", "1")

    def step(self, t: float, h: float) -> None:
        """Advance x' = u + w exactly, both being held."""
        self.x = self.x + h * (self.u + self.w)
