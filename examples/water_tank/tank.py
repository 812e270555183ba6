"""A tank that water flows into all the time, and out of while its valve is open."""

from fmu_kit.slave import Slave
from fmu_kit.variables import continuous_input, continuous_output, fixed_parameter


class Tank(Slave):
    """level' = inflow - outflow · valve_control, with the valve held over a step."""

    variables = (
        continuous_input("valve_control", "0 closed, 1 open", "1"),
        continuous_output("level", "of the water", "m"),
        fixed_parameter("inflow", "rise of the level with the valve closed", "m/s", 1.0, minimum=0.0),
        fixed_parameter("outflow", "fall of the level by the open valve", "m/s", 2.0, minimum=0.0),
        fixed_parameter("initial.level", "level(0)", "m", 0.0),
    )
    description = "Water tank: valve in, level out"
    initial_outputs_depend_on_inputs = False

    def initialise(self, t: float) -> None:
        """Start at the initial level."""
        self.put("level", self.real("initial.level"))

    def step(self, t: float, h: float) -> None:
        """Advance exactly; a tank does not get emptier than empty."""
        flow = self.real("inflow") - self.real("outflow") * self.real("valve_control")
        self.put("level", max(0.0, self.real("level") + flow * h))
