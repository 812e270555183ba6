"""Geometric tracking control on SE(3), equation by equation.

Source: T. Lee, M. Leok, N. H. McClamroch, "Geometric Tracking Control of a Quadrotor UAV on SE(3)", 49th IEEE
Conference on Decision and Control (CDC), 2010; their "Control of Complex Maneuvers for a Quadrotor UAV using
Geometric Methods on SE(3)", arXiv:1003.2005, gives the derivatives. Names in the comments are theirs.

Their R takes body to inertial components, and so is R(Q)ᵀ here; b_i are the body's axes in inertial components, the
columns of R. Their A [N] is -m u here, and all that they divide by m is divided here from the start: k_x and k_v are
per unit mass, as in their example, so that the desired attitude does not depend on the mass.

Everything here is a pure function of the state, the reference and the parameters, on any scalar.
Inertial frame north-east-down, body frame forward-right-down, SI units; `_c` computed, `_d` desired, `_dot` rate;
errors are actual minus desired.
"""

from dataclasses import dataclass
from typing import NamedTuple

from controller_fmu.gain_scaling import feedback
from controller_fmu.vehicle import Measurement, Model
from fmu_kit.algebra import ZERO, Quaternion, Vec3
from fmu_kit.errors import DivergenceError
from fmu_kit.scalar import FLOAT, Scalar, ScalarOps
from fmu_kit.trajectory import Reference

SMALLEST_ACCELERATION = 1e-9
"""Acceleration |A|/m [m/s²] below which it counts as zero, and b3c as undefined."""
SMALLEST_SINE = 1e-9
"""Value of |b3c × b1d| below which it counts as zero, and b2c as undefined."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Gains:
    """The gains of the law. The attitude gains are those of the published example, per unit inertia.

    The position gains have half its natural frequency and the same damping: it has k_x/m = 16 and k_v/m = 5.6.
    """

    k_x: float = 4.0
    """position, k_x/m [1/s²]"""
    k_v: float = 2.8
    """velocity, k_v/m [1/s]"""
    k_R: float = 104.26  # noqa: N815
    """attitude, k_R [N·m], per unit inertia [1/s²]"""
    k_Omega: float = 30.06  # noqa: N815
    """angular velocity, k_Ω [N·m·s], per unit inertia [1/s]"""
    per_inertia: bool = False
    """Whether k_R and k_Ω stand for the matrices k_R J and k_Ω J."""


class Heading(NamedTuple):
    """The desired direction of b1, and its rates; of unit length, as in the paper, or of any other."""

    direction: Vec3 = Vec3(1.0, 0.0, 0.0)
    """b1d [1], inertial"""
    direction_dot: Vec3 = ZERO
    """First derivative of the direction [1/s]"""
    direction_ddot: Vec3 = ZERO
    """Second derivative of the direction [1/s²]"""

    @classmethod
    def at(cls, yaw: Scalar, rate: Scalar, ops: ScalarOps = FLOAT) -> "Heading":
        """The heading of a yaw [rad], from x of the inertial frame towards y, with a constant rate [rad/s]."""
        sine, cosine = ops.sin(yaw), ops.cos(yaw)
        return cls(
            Vec3(cosine, sine, 0.0),
            Vec3(-rate * sine, rate * cosine, 0.0),
            Vec3(-rate * rate * cosine, -rate * rate * sine, 0.0),
        )


NORTH = Heading()


class Evaluation(NamedTuple):
    """The command and every intermediate quantity of one evaluation of the law."""

    thrust: Scalar
    """f [N], along -z of the body; may be negative"""
    torque: Vec3
    """M [N·m], body"""
    position_error: Vec3
    """e_x [m], inertial"""
    velocity_error: Vec3
    """e_v [m/s], inertial"""
    acceleration_error: Vec3
    """e_a [m/s²], rate of e_v in the model"""
    jerk_error: Vec3
    """e_j [m/s³], rate of e_a"""
    force: Vec3
    """-A/m [m/s²], inertial"""
    force_dot: Vec3
    """First derivative of the force by the mass [m/s³]"""
    force_ddot: Vec3
    """Second derivative of the force by the mass [m/s⁴]"""
    desired_quaternion: Quaternion
    """Q_d with R(Q_d)ᵀ = R_c"""
    desired_angular_velocity: Vec3
    """Ω_c [rad/s], desired body frame"""
    desired_angular_acceleration: Vec3
    """dΩ_c [rad/s²], desired body frame"""
    attitude_error: Quaternion
    """Q̃, desired to actual body frame"""
    angular_velocity_error: Vec3
    """e_Ω [rad/s], body"""
    rotation_error: Vec3
    """e_R [1], body"""
    error_function: Scalar
    """Ψ [1], from 0 to 2"""
    energy: Scalar
    """½ k_x e_x·e_x + ½ m e_v·e_v + ½ e_Ω·Je_Ω + k_R Ψ [J]; with gains per unit inertia that of m = 1, J = I, [1/s²]"""


class Unit(NamedTuple):
    """A unit vector and its first two time derivatives."""

    value: Vec3
    dot: Vec3
    ddot: Vec3

    def cross(self, other: "Unit | Heading") -> tuple[Vec3, Vec3, Vec3]:
        """The vector product with another moving vector, and its first two derivatives."""
        (a, a_dot, a_ddot), (b, b_dot, b_ddot) = self, other
        return (
            a.cross(b),
            a_dot.cross(b) + a.cross(b_dot),
            a_ddot.cross(b) + 2.0 * a_dot.cross(b_dot) + a.cross(b_ddot),
        )


def unit(v: Vec3, v_dot: Vec3, v_ddot: Vec3, length: Scalar) -> Unit:
    """v/|v| and its derivatives, for a vector of this length, not zero."""
    direction = v / length
    length_dot = direction @ v_dot
    direction_dot = (v_dot - length_dot * direction) / length
    length_ddot = direction_dot @ v_dot + direction @ v_ddot
    return Unit(
        direction, direction_dot, (v_ddot - length_ddot * direction - (2.0 * length_dot) * direction_dot) / length
    )


class Frame(NamedTuple):
    """The columns of R_c, inertial components, with their derivatives."""

    b1: Unit
    b2: Unit
    b3: Unit

    def angular_velocity(self) -> Vec3:
        """Ω_c = (R_cᵀ dR_c)^∨ [rad/s], in the frame itself."""
        b1, b2, b3 = self
        return Vec3(b3.value @ b2.dot, b1.value @ b3.dot, b2.value @ b1.dot)

    def angular_acceleration(self, omega: Vec3) -> Vec3:
        """dΩ_c = (R_cᵀ ddR_c - Ω̂_c²)^∨ [rad/s²], in the frame itself."""
        b1, b2, b3 = self
        return Vec3(
            b3.value @ b2.ddot - omega.y * omega.z,
            b1.value @ b3.ddot - omega.z * omega.x,
            b2.value @ b1.ddot - omega.x * omega.y,
        )


def computed_frame(u: Vec3, u_dot: Vec3, u_ddot: Vec3, heading: Heading, ops: ScalarOps = FLOAT) -> Frame:
    """R_c with its third axis along `u` = -A/m [m/s²] and its first axis as near to b1d as possible.

    Raises `DivergenceError` where u vanishes or points along b1d or against it: there is no such frame.
    """
    n = u.norm(ops)
    if not ops.all(n >= SMALLEST_ACCELERATION):
        raise DivergenceError(
            f"-A/m = ({u.x}, {u.y}, {u.z}) m/s2: expected a length of at least {SMALLEST_ACCELERATION} m/s2, "
            "the desired attitude does not exist"
        )
    b3 = unit(u, u_dot, u_ddot, n)
    side, side_dot, side_ddot = b3.cross(heading)
    sine = side.norm(ops)
    if not ops.all(sine >= SMALLEST_SINE):
        b1d = heading.direction
        raise DivergenceError(
            f"-A/m = ({u.x}, {u.y}, {u.z}) m/s2: expected a direction other than that of b1d = ({b1d.x}, {b1d.y}, "
            f"{b1d.z}), |b3c x b1d| of at least {SMALLEST_SINE}, the desired attitude does not exist"
        )
    b2 = unit(side, side_dot, side_ddot, sine)
    return Frame(Unit(*b2.cross(b3)), b2, b3)


def evaluate(
    state: Measurement,
    reference: Reference,
    gains: Gains,
    model: Model,
    ops: ScalarOps = FLOAT,
    heading: Heading = NORTH,
) -> Evaluation:
    """Thrust and torque that track the path of `reference` and `heading` from `state`, with intermediate quantities.

    Scalars may be floats or batches; every component of the result has the (broadcast) shape of the inputs.
    `state.quaternion` must have unit length; Q and -Q give the same command. Rates are the model's predictions,
    without wind and with the commanded thrust, negative or not.

    Raises `DivergenceError` where the desired attitude does not exist.
    """
    Q, omega, J, g = state.quaternion, state.angular_velocity, model.inertia, model.gravity
    k_x, k_v = gains.k_x, gains.k_v
    b3, b3_dot = Q.z_axis(), Q.to_inertial(Vec3(omega.y, -omega.x, 0.0))  # R Ω̂ z

    e_x = state.position - reference.position
    e_v = state.velocity - reference.velocity
    F = reference.acceleration - k_x * e_x - k_v * e_v
    u = Vec3(-F.x, -F.y, g - F.z)  # -A/m
    lift = u @ b3  # f/m = -A·b3/m
    e_a = Vec3(0.0, 0.0, g) - lift * b3 - reference.acceleration
    u_dot = k_x * e_v + k_v * e_a - reference.jerk
    lift_dot = u_dot @ b3 + u @ b3_dot
    e_j = -(lift_dot * b3) - lift * b3_dot - reference.jerk
    u_ddot = k_x * e_a + k_v * e_j - reference.snap

    frame = computed_frame(u, u_dot, u_ddot, heading, ops)
    omega_c = frame.angular_velocity()
    omega_c_dot = frame.angular_acceleration(omega_c)
    Q_c = Quaternion.from_axes(frame.b1.value, frame.b2.value, frame.b3.value, ops)

    Q_err = Q_c.inverse() * Q  # R(Q̃) = Rᵀ R_c
    q, q0 = Q_err.vector, Q_err.scalar
    e_R = (2.0 * q0) * q  # ½ (R_cᵀ R - Rᵀ R_c)^∨
    psi = 2.0 * (q @ q)  # ½ tr(I - R_cᵀ R)
    omega_c_body = Q_err.to_body(omega_c)
    e_Omega = omega - omega_c_body

    damping, restoring, momentum = feedback(gains.per_inertia, J, gains.k_Omega * e_Omega, gains.k_R * e_R, e_Omega)
    feedforward = Q_err.to_body(omega_c_dot) - omega.cross(omega_c_body)
    torque = omega.cross(J @ omega) + J @ feedforward - damping - restoring
    mass = ops.where(gains.per_inertia, 1.0, model.mass)
    energy = 0.5 * (mass * (k_x * (e_x @ e_x) + e_v @ e_v) + e_Omega @ momentum) + gains.k_R * psi

    return Evaluation(
        thrust=model.mass * lift,
        torque=torque,
        position_error=e_x,
        velocity_error=e_v,
        acceleration_error=e_a,
        jerk_error=e_j,
        force=u,
        force_dot=u_dot,
        force_ddot=u_ddot,
        desired_quaternion=Q_c,
        desired_angular_velocity=omega_c,
        desired_angular_acceleration=omega_c_dot,
        attitude_error=Q_err,
        angular_velocity_error=e_Omega,
        rotation_error=e_R,
        error_function=psi,
        energy=energy,
    )
