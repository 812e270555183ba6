"""A double integrator, solved exactly over each step."""

from fmu_kit.interface import Input, State
from fmu_kit.slave import Slave


class DoubleIntegrator(Slave):
    """Double integrator: acceleration in, position and velocity out."""

    u = Input("acceleration", "m/s2")
    x = State("position", "m", 1.0)
    v = State("velocity", "m/s")

    def step(self, t: float, h: float) -> None:
        """Advance x'' = u exactly, u being held."""
        x, v, u = self.x, self.v, self.u
        self.x = x + h * v + 0.5 * h * h * u
        self.v = v + h * u
