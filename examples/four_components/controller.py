"""A cruise controller."""

from fmu_kit.interface import Input, Local, Output, Parameter
from fmu_kit.slave import Slave


class CruiseController(Slave):
    """Cruise controller: speed in, force out.

    PI with an integral that stops where the engine is at its limit.
    """

    speed = Input("measured speed", "m/s")
    set_speed = Input("desired speed", "m/s")
    force = Output("force asked of the engine", "N")
    integral = Local("part of the force, after the last sample", "N")
    k_p = Parameter("gain of the error", "N.s/m", 1200.0)
    k_i = Parameter("gain of its integral", "N/m", 300.0)
    force_max = Parameter("largest force of the engine", "N", 4000.0, above=0.0)
    first_force = Parameter("force before the first sample, and integral(0)", "N", 800.0, name="initial.force")

    initial_outputs_depend_on_inputs = False

    def initialise(self, t: float) -> None:
        """Command the initial force."""
        self.force = self.integral = self.first_force

    def step(self, t: float, h: float) -> None:
        """Sample; `h` is the time until the next one."""
        error = self.set_speed - self.speed
        demand = self.k_p * error + self.integral
        self.force = min(max(demand, 0.0), self.force_max)
        if self.force == demand:
            self.integral = self.integral + self.k_i * h * error
