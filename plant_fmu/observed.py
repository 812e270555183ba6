"""What is observed of the plant beside its motion: each variable, and its value."""

import math

from fmu_kit import frames
from fmu_kit.algebra import ZERO, Quaternion, Vec3
from fmu_kit.interface import Local
from fmu_kit.rigid_body import Body, Wrench, acceleration, tilt
from plant_fmu.interface import PlantInterface
from plant_fmu.wind import Wind


class Observed(PlantInterface):
    """Variables that follow from the motion and from what acts on it.

    An `Output` among them is not said to depend on some inputs and parameters alone, unless `initial_dependencies` of
    the slave does.
    """

    acceleration = Local("dV/dt, inertial frame", "m/s2", ZERO, variability="continuous", frame=frames.inertial)
    wind_force = Local(
        "wind force, inertial frame",
        "N",
        ZERO,
        name="wind.force",
        variability="continuous",
        nominal=Wind().amplitude.x,
        frame=frames.inertial,
    )
    tilt = Local(
        "angle between the z axes of body and inertial frame",
        "rad",
        variability="continuous",
        minimum=0.0,
        maximum=math.pi,
    )

    def observe(self, attitude: Quaternion, wrench: Wrench, wind: Vec3, body: Body) -> None:
        """Set them, after each step and where a solver asks for derivatives.

        `attitude` has length one, `wrench` is that of the propellers as it acts, `body` has the mass that is carried;
        position, velocity and angular velocity are attributes.
        """
        self.acceleration = acceleration(attitude, wrench.thrust, wind + self.external_force, body)
        self.wind_force, self.tilt = wind, tilt(attitude)
