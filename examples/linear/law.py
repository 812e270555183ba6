"""PID on the position over PD on the attitude: the form of LQR, LQI and PID of a hovering quadrotor."""

from fmu_kit.algebra import ZERO, Inertia, Quaternion, Vec3
from fmu_kit.interface import Input, Local, Output, Parameter
from fmu_kit.slave import Slave


class LinearFeedback(Slave):
    """Linear feedback of the whole state about hover, with an integral of the position."""

    position = Input("measured position: north, east, down", "m", ZERO)
    velocity = Input("measured velocity: north, east, down", "m/s", ZERO)
    quaternion = Input("measured attitude, scalar last", "1", Quaternion(ZERO, 1.0))
    angular_velocity = Input("measured angular velocity, about the body's axes: forward, right, down", "rad/s", ZERO)
    target = Input("position to fly to", "m", ZERO, name="reference.position")
    target_velocity = Input("velocity of the target", "m/s", ZERO, name="reference.velocity")
    target_acceleration = Input("acceleration of the target", "m/s2", ZERO, name="reference.acceleration")

    thrust = Output("thrust of all propellers, upward in the body", "N", 9.81)
    torque = Output("torque about the body's axes", "N.m", ZERO)
    integral = Local("integral of the error, at the next sample", "m.s", ZERO)

    k_p = Parameter("gain of the position", "1/s2", Vec3(4.0, 4.0, 4.0))
    k_d = Parameter("gain of the velocity", "1/s", Vec3(3.5, 3.5, 3.5))
    k_i = Parameter("gain of the integral", "1/s3", ZERO)
    k_tilt = Parameter("gain of the attitude", "1/s2", Vec3(100.0, 100.0, 100.0))
    k_rate = Parameter("gain of the angular velocity", "1/s", Vec3(18.0, 18.0, 18.0))
    pull_max = Parameter("largest acceleration that errors may ask for, along each axis", "m/s2", 5.0, above=0.0)
    mass = Parameter("mass of the vehicle", "kg", 1.0, above=0.0)
    inertia = Parameter("inertia of the vehicle, about the body's axes", "kg.m2", Inertia(xx=1.0, yy=1.0, zz=1.0))
    gravity = Parameter("gravity of the place", "m/s2", 9.81, above=0.0)

    def step(self, t: float, h: float) -> None:
        """Sample: the command first, then the integral, which stops while the pull is at its bound."""
        if not any(self.quaternion):
            return  # no measurement yet, as with some masters
        error = self.target - self.position
        demand = self.k_p * error + self.k_d * (self.target_velocity - self.velocity) + self.k_i * self.integral
        pull = demand.map(self._bounded)
        acceleration, q = self.target_acceleration + pull, self.quaternion
        self.thrust = max(0.0, self.mass * (self.gravity - acceleration.z))
        tilt = Vec3(acceleration.y / self.gravity, -acceleration.x / self.gravity, 0.0)
        lag = tilt - 2.0 * q.scalar * q.vector  # near level, the angles of the body
        self.torque = self.inertia @ (self.k_tilt * lag - self.k_rate * self.angular_velocity)
        self.integral = self.integral + h * Vec3(
            error.x if pull.x == demand.x else 0.0,
            error.y if pull.y == demand.y else 0.0,
            error.z if pull.z == demand.z else 0.0,
        )

    def _bounded(self, pull: float) -> float:
        bounded: float = min(max(pull, -self.pull_max), self.pull_max)
        return bounded
