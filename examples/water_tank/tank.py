"""A tank with a constant inflow, and an outflow while its valve is open."""

from fmu_kit.interface import Input, Parameter, State
from fmu_kit.slave import Slave


class Tank(Slave):
    """Water tank: valve in, level out."""

    valve_control = Input("position of the valve: 0 closed, 1 open", "1")
    level = State("level of the water", "m")
    inflow = Parameter("rise of the level with the valve closed", "m/s", 1.0, minimum=0.0)
    outflow = Parameter("fall of the level by the open valve", "m/s", 2.0, minimum=0.0)

    def step(self, t: float, h: float) -> None:
        """Advance level' = inflow - outflow · valve_control exactly, with level at least 0."""
        flow = self.inflow - self.outflow * self.valve_control
        self.level = max(0.0, self.level + flow * h)
