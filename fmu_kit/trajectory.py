"""The built-in reference trajectory and its exact derivatives up to snap.

Controller FMUs bundle this module and the metrics import it, so that both use the same P_d(t).
"""

from dataclasses import dataclass, fields

from fmu_kit.algebra import ZERO, Vec3
from fmu_kit.frames import about_z, inertial, yaw
from fmu_kit.scalar import FLOAT, Scalar, ScalarOps


@dataclass(frozen=True, kw_only=True, slots=True)
class Reference:
    """The desired motion at one time, inertial frame."""

    position: Vec3
    """P_d [m]"""
    velocity: Vec3 = ZERO
    """V_d [m/s]"""
    acceleration: Vec3 = ZERO
    """A_d [m/s²]"""
    jerk: Vec3 = ZERO
    """J_d [m/s³]"""
    snap: Vec3 = ZERO
    """S_d [m/s⁴]"""
    yaw: Scalar = 0.0
    """ψ_d [rad], direction of the nose, from x towards y"""
    yaw_rate: Scalar = 0.0
    """dψ_d [rad/s]; its own rate is taken to be zero"""

    def turned(self, turned: Scalar) -> "Reference":
        """The same motion, in the other axes convention where `turned` holds (`fmu_kit.frames`)."""
        turns = {"yaw": yaw, "yaw_rate": about_z}
        conversions = {each.name: turns.get(each.name, inertial) for each in fields(self)}
        return Reference(**{name: turn(turned, getattr(self, name)) for name, turn in conversions.items()})

    def after(self, time: Scalar) -> "Reference":
        """The desired motion `time` [s] later, by its Taylor series up to snap."""
        v, a, j, s = self.velocity, self.acceleration, self.jerk, self.snap
        second, third, fourth = time / 2.0, time / 3.0, time / 4.0
        return Reference(
            position=self.position.plus(time, v.plus(second, a.plus(third, j.plus(fourth, s)))),
            velocity=v.plus(time, a.plus(second, j.plus(third, s))),
            acceleration=a.plus(time, j.plus(second, s)),
            jerk=j.plus(time, s),
            snap=s,
            yaw=self.yaw + time * self.yaw_rate,
            yaw_rate=self.yaw_rate,
        )


@dataclass(frozen=True, kw_only=True, slots=True)
class Trajectory:
    """P_d(t) = [a_x sin ωt cos ωt, a_y sin ωt, start_z + rate_z t], the paper's figure of eight (section V).

    With ψ_d(t) = yaw + yaw_rate t. The defaults are the paper's, with z down, so that a positive `rate_z` descends.
    """

    amplitude_x: float = 4.0
    """a_x [m]"""
    amplitude_y: float = 4.0
    """a_y [m]"""
    frequency: float = 0.15
    """ω [rad/s]"""
    start_z: float = 2.0
    """Start of z [m]"""
    rate_z: float = 0.1
    """Rate of z [m/s]"""
    yaw: float = 0.0
    """Yaw [rad]"""
    yaw_rate: float = 0.0
    """Rate of the yaw [rad/s]"""

    def position(self, t: Scalar, ops: ScalarOps = FLOAT) -> Vec3:
        """P_d [m] at `t` [s]."""
        return Vec3(
            0.5 * self.amplitude_x * ops.sin(2.0 * self.frequency * t),
            self.amplitude_y * ops.sin(self.frequency * t),
            self.start_z + self.rate_z * t,
        )

    def at(self, t: Scalar, ops: ScalarOps = FLOAT) -> Reference:
        """P_d and its first four time derivatives at `t` [s], each a `Vec3` of scalars shaped as `t`, and ψ_d."""
        w, w2 = self.frequency, 2.0 * self.frequency
        a, b = 0.5 * self.amplitude_x, self.amplitude_y  # a_x sin ωt cos ωt = ½ a_x sin 2ωt
        position = self.position(t, ops)
        sin_x, cos_x = ops.sin(w2 * t), ops.cos(w2 * t)
        sin_y, cos_y = ops.sin(w * t), ops.cos(w * t)
        zero = 0.0 * t
        return Reference(
            position=position,
            velocity=Vec3(a * w2 * cos_x, b * w * cos_y, self.rate_z + zero),
            acceleration=Vec3(-a * w2**2 * sin_x, -b * w**2 * sin_y, zero),
            jerk=Vec3(-a * w2**3 * cos_x, -b * w**3 * cos_y, zero),
            snap=Vec3(a * w2**4 * sin_x, b * w**4 * sin_y, zero),
            yaw=self.yaw + self.yaw_rate * t,
            yaw_rate=self.yaw_rate + zero,
        )
