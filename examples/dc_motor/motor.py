"""A DC motor with a load, by Runge and Kutta's method."""

from typing import NamedTuple

from fmu_kit.integrator import rk4_step
from fmu_kit.interface import Input, Parameter, State
from fmu_kit.slave import Slave


class Motion(NamedTuple):
    """The state that is integrated, and its rate."""

    current: float
    speed: float

    def plus(self, h: float, rate: "Motion") -> "Motion":
        """As `rk4_step` needs it."""
        return Motion(self.current + h * rate.current, self.speed + h * rate.speed)


class Motor(Slave):
    """DC motor: voltage and torque of the load in, current and speed out."""

    voltage = Input("voltage", "V")
    load = Input("torque of the load", "N.m")
    current = State("current", "A")
    speed = State("speed", "rad/s")
    resistance = Parameter("resistance", "Ohm", 1.0, above=0.0)
    inductance = Parameter("inductance", "H", 1e-3, above=0.0)
    constant = Parameter("torque by current, and voltage by speed", "N.m/A", 0.05)
    inertia = Parameter("inertia with the load", "kg.m2", 1e-4, above=0.0)
    friction = Parameter("torque by speed", "N.m.s/rad", 1e-5)

    def rate(self, t: float, x: Motion) -> Motion:
        """The differential equation, voltage and load held."""
        current = (self.voltage - self.resistance * x.current - self.constant * x.speed) / self.inductance
        return Motion(current, (self.constant * x.current - self.friction * x.speed - self.load) / self.inertia)

    def step(self, t: float, h: float) -> None:
        """From t to t + h, in one step, which is short beside inductance / resistance."""
        self.current, self.speed = rk4_step(self.rate, t, Motion(self.current, self.speed), h)
