"""The unified finite-time sliding-mode law, equation by equation.

Source: Ali, Hashim, Jayasiri, "A Unified Finite-Time Sliding Mode Quaternion-based Tracking Control for
Quadrotor UAVs without Time Scale Separation", ACC 2025. `# (22)` is the paper's equation 22; where the
printed equation is inconsistent, the code has the consistent one and names the erratum of `docs/law.md`.

Everything here is a pure function of the state, the reference and the parameters, on any scalar.
Inertial frame north-east-down, body frame forward-right-down, SI units; `_d` desired, `_dot` rate;
errors are actual minus desired.
"""

from dataclasses import dataclass
from typing import NamedTuple

from controller_fmu.gain_scaling import feedback
from controller_fmu.vehicle import Measurement, Model
from fmu_kit.algebra import Quaternion, Vec3
from fmu_kit.errors import DivergenceError
from fmu_kit.scalar import FLOAT, Scalar, ScalarOps, repeat
from fmu_kit.trajectory import Reference

SMALLEST_ACCELERATION = 1e-9
"""Acceleration n or n + g - F_z below which it counts as zero [m/s²] and (12) as unsolvable."""
NEWTON_STEPS = 8
"""Iterations of `implicit_sliding`: enough for all digits where time k is up to 100 m/s."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Gains:
    """The gains of the law; the defaults are the paper's (section V) where it gives a value."""

    k_t: Vec3 = Vec3(2.0, 2.0, 2.0)
    """translation, k_t [m/s²]"""
    beta: float = 0.99
    """disturbance, β of Υ [m/s²]"""
    k_s: float = 5.0
    """sliding surface, k_s [1/s at β_t = 1]"""
    beta_t: float = 0.99
    """exponent of the surface, β_t [1], in (0, 1]"""
    epsilon: float = 0.001
    """boundary layer, ε [m] (erratum 12)"""
    k_eta: float = 15.0
    """k_η [rad/s]"""
    k_theta: float = 15.0
    """k_θ [N·m·s], per unit inertia [1/s]"""
    k_q: float = 15.0
    """attitude, k_q [N·m], per unit inertia [1/s²]"""
    kappa: float = 1.0
    """κ [kg], weight of ½ s·s in the energy, and so of its term in Ψ: any κ >= 0 has the proof (erratum 8).

    0: none; 1: as the energy is printed; k_q: as Ψ is printed. Per unit inertia [1/m²].
    """
    per_inertia: bool = False
    """Whether k_θ and k_q stand for the matrices k_θ J and k_q J in (30), and κ/k_q for a weight per unit inertia."""


class Evaluation(NamedTuple):
    """The command and every intermediate quantity of one evaluation of the law."""

    thrust: Scalar
    """T [N], along -z of the body"""
    torque: Vec3
    """Γ [N·m], body"""
    position_error: Vec3
    """e [m], inertial"""
    velocity_error: Vec3
    """ev [m/s], inertial"""
    attitude_error: Quaternion
    """Q̃, desired to actual body frame"""
    angular_velocity_error: Vec3
    """Ω̃ [rad/s], body"""
    sliding: Vec3
    """s [m/s], inertial"""
    sliding_dot: Vec3
    """ds [m/s²]"""
    virtual_control: Vec3
    """F [m/s²], inertial"""
    virtual_control_dot: Vec3
    """dF [m/s³]"""
    virtual_control_ddot: Vec3
    """ddF [m/s⁴]"""
    desired_quaternion: Quaternion
    """Q_d"""
    desired_angular_velocity: Vec3
    """Ω_d [rad/s], desired body frame"""
    desired_angular_acceleration: Vec3
    """dΩ_d [rad/s²], desired body frame"""
    psi: Vec3
    """Ψ [rad/s], body"""
    psi_dot: Vec3
    """dΨ [rad/s²]"""
    theta: Vec3
    """Θ [rad/s], body"""
    energy: Scalar
    """L_κ (33) [J]; with gains per unit inertia that of J = I, [1/s²]"""


class Surface(NamedTuple):
    """Slopes of k_s |e|^β_t sgn(e), per axis: γ with γ e = k_s |e|^β_t sgn(e), γ' = d/de, γ'' = d²/de²."""

    gamma: Vec3
    gamma_prime: Vec3
    gamma_second: Vec3


def surface(e: Vec3, gains: Gains, ops: ScalarOps = FLOAT) -> Surface:
    """The sliding surface at position error `e` [m]; inside |e| < ε it is the line k_s e (β_t := 1)."""
    k_s, beta_t, epsilon = gains.k_s, gains.beta_t, gains.epsilon

    def axis(e: Scalar) -> tuple[Scalar, Scalar, Scalar]:
        outside = abs(e) >= epsilon
        size = ops.maximum(abs(e), epsilon)  # never 0, so that the power is defined where it is not used
        gamma = k_s * size ** (beta_t - 1.0)
        gamma_prime = beta_t * gamma
        gamma_second = (beta_t - 1.0) * gamma_prime / size * ops.sign(e)  # sgn of e: erratum 6
        return (
            ops.where(outside, gamma, k_s),
            ops.where(outside, gamma_prime, k_s),
            ops.where(outside, gamma_second, 0.0),
        )

    (x0, x1, x2), (y0, y1, y2), (z0, z1, z2) = axis(e.x), axis(e.y), axis(e.z)
    return Surface(Vec3(x0, y0, z0), Vec3(x1, y1, z1), Vec3(x2, y2, z2))


def desired_attitude(F: Vec3, n: Scalar, gravity: float, ops: ScalarOps = FLOAT) -> Quaternion:
    """Q_d whose thrust axis realises the virtual control `F` [m/s²], with no yaw; n = |g z - F| (12).

    Raises `DivergenceError` where g z - F vanishes or points along -z: no Q_d of this form exists.
    """
    if not ops.all((n >= SMALLEST_ACCELERATION) & (n + gravity - F.z >= SMALLEST_ACCELERATION)):
        raise DivergenceError(
            f"virtual control F = ({F.x}, {F.y}, {F.z}) m/s2: expected n = |g z - F| and n + g - F.z "
            f"of at least {SMALLEST_ACCELERATION} m/s2, the desired attitude (12) does not exist"
        )
    q_d0 = ops.sqrt((gravity - F.z) / (2.0 * n) + 0.5)
    return Quaternion(Vec3(F.y, -F.x, 0.0) / (2.0 * n * q_d0), q_d0)


class Turn:
    """The rotation of the desired attitude about its thrust axis by a yaw ψ [rad] of constant rate [rad/s]: our own.

    The rest of the law is unchanged: (3) depends only on the thrust axis of Q_d, and the proof on Ω_d being its rate.
    """

    def __init__(self, yaw: Scalar, rate: Scalar, ops: ScalarOps = FLOAT) -> None:
        half = 0.5 * yaw
        sine, cosine = ops.sin(half), ops.cos(half)
        self._half_sine, self._half_cosine, self._rate = sine, cosine, rate
        self._sine, self._cosine = 2.0 * sine * cosine, cosine * cosine - sine * sine

    def attitude(self, Q_d: Quaternion) -> Quaternion:
        """Q_d ⊙ Q_ψ, of a Q_d without yaw (12)."""
        q, q0, s, c = Q_d.vector, Q_d.scalar, self._half_sine, self._half_cosine
        return Quaternion(Vec3(c * q.x + s * q.y, c * q.y - s * q.x, s * q0), c * q0)

    def angular_velocity(self, omega_d: Vec3) -> Vec3:
        """R(Q_ψ) Ω_d + dψ z [rad/s], desired body frame."""
        turned = self._turned(omega_d)
        return Vec3(turned.x, turned.y, turned.z + self._rate)

    def angular_acceleration(self, omega_d: Vec3, omega_d_dot: Vec3) -> Vec3:
        """R(Q_ψ) dΩ_d - dψ z × R(Q_ψ) Ω_d [rad/s²], desired body frame."""
        turned, rate = self._turned(omega_d), self._turned(omega_d_dot)
        return Vec3(rate.x + self._rate * turned.y, rate.y - self._rate * turned.x, rate.z)

    def _turned(self, v: Vec3) -> Vec3:
        s, c = self._sine, self._cosine
        return Vec3(c * v.x + s * v.y, c * v.y - s * v.x, v.z)


class DesiredRate:
    """Φ(F) of (14) and its time derivative: from the rates of F to those of the desired attitude."""

    def __init__(self, F: Vec3, F_dot: Vec3, n: Scalar, n_dot: Scalar, gravity: float) -> None:
        self._F, self._F_dot = F, F_dot
        self._a1, self._a1_dot = n, n_dot
        self._a2, self._a2_dot = n + gravity - F.z, n_dot - F_dot.z
        self._scale = 1.0 / (n * n * self._a2)

    def angular_velocity(self) -> Vec3:
        """Ω_d = Φ(F) dF [rad/s], desired body frame (13) (erratum 4)."""
        omega_d: Vec3 = self._scale * self._numerator(self._F_dot)
        return omega_d

    def angular_acceleration(self, F_ddot: Vec3) -> Vec3:
        """dΩ_d = dΦ dF + Φ ddF [rad/s²], desired body frame (erratum 4)."""
        relative = 2.0 * self._a1_dot / self._a1 + self._a2_dot / self._a2  # of the denominator α1² α2
        numerator = self._numerator(F_ddot) + self._numerator_dot(self._F_dot) - relative * self._numerator(self._F_dot)
        omega_d_dot: Vec3 = self._scale * numerator
        return omega_d_dot

    def _numerator(self, v: Vec3) -> Vec3:
        x, y, a1, a2 = self._F.x, self._F.y, self._a1, self._a2
        a = a1 * a2
        return Vec3(
            -x * y * v.x + (a - y * y) * v.y + y * a2 * v.z,
            (x * x - a) * v.x + x * y * v.y - x * a2 * v.z,
            a1 * (y * v.x - x * v.y),
        )

    def _numerator_dot(self, v: Vec3) -> Vec3:
        x, y, a1, a2 = self._F.x, self._F.y, self._a1, self._a2
        dx, dy, da1, da2 = self._F_dot.x, self._F_dot.y, self._a1_dot, self._a2_dot
        da, dxy = da1 * a2 + a1 * da2, dx * y + x * dy
        return Vec3(
            -dxy * v.x + (da - 2.0 * y * dy) * v.y + (dy * a2 + y * da2) * v.z,
            (2.0 * x * dx - da) * v.x + dxy * v.y - (dx * a2 + x * da2) * v.z,
            (dy * a1 + y * da1) * v.x - (dx * a1 + x * da1) * v.y,
        )


def implicit_sliding(s: Vec3, time: Scalar, k: Vec3, ops: ScalarOps = FLOAT) -> Vec3:
    """σ [m/s] with σ + time k tanh σ = s: the implicit Euler step of ds/dt = -k tanh s over `time` [s].

    Newton's method for |s| on each axis, from below: the left side is concave there, so that no step overshoots.
    """
    if time == 0.0:
        return s

    def newton_step(x: Scalar, size: Scalar, a: Scalar) -> Scalar:
        tanh = ops.tanh(x)
        return x - (x + a * tanh - size) / (1.0 + a * (1.0 - tanh * tanh))

    a, size = time * k, s.map(abs)
    start = Vec3(*(ops.maximum(s / (1.0 + a), s - a) for s, a in zip(size, a)))
    found = repeat(NEWTON_STEPS, lambda i, x: Vec3(*map(newton_step, x, size, a)), start)
    sigma: Vec3 = s.map(ops.sign) * found
    return sigma


def evaluate(
    state: Measurement,
    reference: Reference,
    gains: Gains,
    model: Model,
    ops: ScalarOps = FLOAT,
    implicit: Scalar = 0.0,
) -> Evaluation:
    """Thrust and torque that track `reference` from `state`, with all intermediate quantities.

    Scalars may be floats or batches; every component of the result has the (broadcast) shape of the
    inputs. `state.quaternion` must have unit length. Rates are the model's predictions, without wind.
    The law is not invariant under Q → -Q: it rotates to q̃_0 = +1, the long way if q̃_0 < 0.
    With `implicit` > 0 [s], it is evaluated at the `implicit_sliding` variable over this time.

    Raises `DivergenceError` where the desired attitude does not exist (12).
    """
    Q, omega, J, g = state.quaternion, state.angular_velocity, model.inertia, model.gravity

    e = state.position - reference.position
    ev = state.velocity - reference.velocity
    gamma, gamma_prime, gamma_second = surface(e, gains, ops)
    k = gains.k_t + Vec3(gains.beta, gains.beta, gains.beta)  # Υ = -β tanh(s) folded in (32)
    s = implicit_sliding(gamma * e + ev, implicit, k, ops)  # (19)-(21)
    tanh_s = s.map(ops.tanh)  # (23)
    F = reference.acceleration - k * tanh_s  # (22)
    u = Vec3(-F.x, -F.y, g - F.z)
    n = u.norm(ops)
    thrust = model.mass * n  # (11)

    turn = Turn(reference.yaw, reference.yaw_rate, ops)
    Q_d = turn.attitude(desired_attitude(F, n, g, ops))  # (12)
    Q_err = Q_d.inverse() * Q  # (8) (erratum 3)
    q, q0 = Q_err.vector, Q_err.scalar
    q_bar = Vec3(q.y, -q.x, -q0)
    tilt = q_bar.cross(q)  # (R(Q)ᵀ - R(Q_d)ᵀ) z = 2 R(Q)ᵀ (q̄ × q̃) (3)

    to_inertial, to_body = Q.to_inertial, Q.to_body
    tilt_inertial = to_inertial(tilt)
    ea = (-2.0 * n) * tilt_inertial + F - reference.acceleration  # (16) without wind
    s_dot = gamma_prime * ev + ea  # (24)
    D = Vec3(1.0, 1.0, 1.0) - tanh_s * tanh_s
    kD = k * D
    F_dot = reference.jerk - kD * s_dot  # (26)
    n_dot = -(u @ F_dot) / n
    rate = DesiredRate(F, F_dot, n, n_dot, g)
    omega_tilt = rate.angular_velocity()  # (13), (14)
    omega_d = turn.angular_velocity(omega_tilt)

    omega_d_body = Q_err.to_body(omega_d)
    omega_err = omega - omega_d_body  # erratum 5
    Q_err_dot = Q_err.rate(omega_err)  # (10) (erratum 2)
    q_dot, q0_dot = Q_err_dot.vector, Q_err_dot.scalar
    q_bar_dot = Vec3(q_dot.y, -q_dot.x, -q0_dot)

    tilt_dot = omega.cross(tilt) + q_bar_dot.cross(q) + q_bar.cross(q_dot)
    ej = F_dot - reference.jerk - (2.0 * n_dot) * tilt_inertial - (2.0 * n) * to_inertial(tilt_dot)  # (28) (erratum 7)
    s_ddot = gamma_second * ev * ev + gamma_prime * ea + ej  # (25)
    D_dot = -2.0 * (tanh_s * D * s_dot)
    F_ddot = reference.snap - k * (D_dot * s_dot) - kD * s_ddot  # (27)
    omega_d_dot = turn.angular_acceleration(omega_tilt, rate.angular_acceleration(F_ddot))

    coupling = 2.0 * gains.kappa / gains.k_q  # the weight κ/k_q: erratum 8
    s_body = to_body(s)
    cross_s = q_bar.cross(s_body)
    psi = -gains.k_eta * q - (coupling * n) * cross_s  # (29)
    s_body_dot = to_body(s_dot) - omega.cross(s_body)
    cross_s_dot = q_bar_dot.cross(s_body) + q_bar.cross(s_body_dot)
    psi_dot = -gains.k_eta * q_dot - coupling * (n_dot * cross_s + n * cross_s_dot)  # (31) (erratum 9)
    theta = omega_err - psi  # (9)
    damping, restoring, J_theta = feedback(gains.per_inertia, J, gains.k_theta * theta, gains.k_q * q, theta)
    feedforward = Q_err.to_body(omega_d_dot) - omega_err.cross(omega_d_body) + psi_dot
    torque = omega.cross(J @ omega) + J @ feedforward - damping - restoring  # (30)
    energy = 2.0 * gains.k_q * (1.0 - q0) + 0.5 * (theta @ J_theta) + 0.5 * gains.kappa * (s @ s)  # (33) (errata 8, 10)

    return Evaluation(
        thrust=thrust,
        torque=torque,
        position_error=e,
        velocity_error=ev,
        attitude_error=Q_err,
        angular_velocity_error=omega_err,
        sliding=s,
        sliding_dot=s_dot,
        virtual_control=F,
        virtual_control_dot=F_dot,
        virtual_control_ddot=F_ddot,
        desired_quaternion=Q_d,
        desired_angular_velocity=omega_d,
        desired_angular_acceleration=omega_d_dot,
        psi=psi,
        psi_dot=psi_dot,
        theta=theta,
        energy=energy,
    )
