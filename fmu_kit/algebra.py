"""3-vectors, unit quaternions and inertia matrices over any scalar.

Operators read as the equations do: `a * b` is elementwise (the paper's ∘), `a @ b` the inner product,
`a.cross(b)` the vector product, `Q1 * Q2` the quaternion product ⊙. Components are plain attributes,
used without conversion, so floats, numpy arrays (one value per point) and symbols all work.
Instances are values and are never modified.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

from fmu_kit.scalar import FLOAT, Scalar, ScalarOps


class Vec3:
    """A 3-vector [x, y, z] of scalars; unit and frame are those of the quantity it represents."""

    __slots__ = ("x", "y", "z")
    __array_ufunc__ = None  # numpy on the left of an operator leaves the operation to this class

    def __init__(self, x: Scalar, y: Scalar, z: Scalar) -> None:
        self.x = x
        self.y = y
        self.z = z

    def __add__(self, other: Vec3) -> Vec3:
        return Vec3(self.x + other.x, self.y + other.y, self.z + other.z)

    def __sub__(self, other: Vec3) -> Vec3:
        return Vec3(self.x - other.x, self.y - other.y, self.z - other.z)

    def __neg__(self) -> Vec3:
        return Vec3(-self.x, -self.y, -self.z)

    def __mul__(self, other: Vec3 | Scalar) -> Vec3:
        """The elementwise product with a vector, or the product with a scalar."""
        if type(other) is Vec3:
            return Vec3(self.x * other.x, self.y * other.y, self.z * other.z)
        return Vec3(self.x * other, self.y * other, self.z * other)

    def __rmul__(self, scalar: Scalar) -> Vec3:
        return Vec3(scalar * self.x, scalar * self.y, scalar * self.z)

    def plus(self, factor: Scalar, other: Vec3) -> Vec3:
        """self + factor * other."""
        return Vec3(self.x + factor * other.x, self.y + factor * other.y, self.z + factor * other.z)

    def __truediv__(self, scalar: Scalar) -> Vec3:
        return Vec3(self.x / scalar, self.y / scalar, self.z / scalar)

    def __matmul__(self, other: Vec3) -> Scalar:
        """Inner product."""
        return self.x * other.x + self.y * other.y + self.z * other.z

    def cross(self, other: Vec3) -> Vec3:
        """Vector product, [self]× other."""
        ax, ay, az = self.x, self.y, self.z
        bx, by, bz = other.x, other.y, other.z
        return Vec3(ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx)

    def map(self, function: Callable[[Scalar], Scalar]) -> Vec3:
        """`function` of each component."""
        return Vec3(function(self.x), function(self.y), function(self.z))

    def norm(self, ops: ScalarOps = FLOAT) -> Scalar:
        """Euclidean length."""
        return ops.sqrt(self.x * self.x + self.y * self.y + self.z * self.z)

    def __iter__(self) -> Iterator[Scalar]:
        return iter((self.x, self.y, self.z))

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Vec3):
            return NotImplemented
        return bool(self.x == other.x and self.y == other.y and self.z == other.z)

    def __hash__(self) -> int:
        return hash((self.x, self.y, self.z))

    def __repr__(self) -> str:
        return f"Vec3({self.x!r}, {self.y!r}, {self.z!r})"


ZERO = Vec3(0.0, 0.0, 0.0)


class Quaternion:
    """Q = [q, q0], scalar last: `vector` is q = (x, y, z), `scalar` is q0 = w.

    As an attitude it takes inertial components to body components: `to_body(v)` is R(Q) v of (1),
    `to_inertial(v)` is R(Q)ᵀ v. Q and -Q are the same attitude.
    """

    __slots__ = ("scalar", "vector")

    def __init__(self, vector: Vec3, scalar: Scalar) -> None:
        self.vector = vector
        self.scalar = scalar

    @classmethod
    def from_xyzw(cls, x: Scalar, y: Scalar, z: Scalar, w: Scalar) -> Quaternion:
        """The quaternion of four components, scalar last."""
        return cls(Vec3(x, y, z), w)

    @classmethod
    def from_axes(cls, a: Vec3, b: Vec3, c: Vec3, ops: ScalarOps = FLOAT) -> Quaternion:
        """The attitude of a body whose axes are `a`, `b`, `c` in inertial components: the columns of R(Q)ᵀ.

        Returns that of Q and -Q whose scalar is not negative.
        """
        # Each row is Q times four times one of its components; the row of the largest component loses no digits.
        xx, yy, zz = a.x, b.y, c.z
        xy, yz, zx = a.y + b.x, b.z + c.y, c.x + a.z
        xw, yw, zw = b.z - c.y, c.x - a.z, a.y - b.x
        rows = (
            (1.0 + xx - yy - zz, xy, zx, xw),
            (xy, 1.0 - xx + yy - zz, yz, yw),
            (zx, yz, 1.0 - xx - yy + zz, zw),
        )
        best, row = 1.0 + xx + yy + zz, (xw, yw, zw, 1.0 + xx + yy + zz)
        for i, other in enumerate(rows):
            larger = other[i] > best
            best = ops.where(larger, other[i], best)
            row = tuple(ops.where(larger, theirs, ours) for theirs, ours in zip(other, row))
        length = cls.from_xyzw(*row).norm(ops)
        unit: Quaternion = cls.from_xyzw(*row) / ops.where(row[3] < 0.0, -length, length)
        return unit

    def __mul__(self, other: Quaternion) -> Quaternion:
        """Q1 ⊙ Q2 = [q01 q2 + q02 q1 + q1 × q2, q01 q02 - q1·q2]."""
        q1, q01, q2, q02 = self.vector, self.scalar, other.vector, other.scalar
        return Quaternion(q01 * q2 + q02 * q1 + q1.cross(q2), q01 * q02 - q1 @ q2)

    def __neg__(self) -> Quaternion:
        return Quaternion(-self.vector, -self.scalar)

    @staticmethod
    def where(condition: Any, a: Quaternion, b: Quaternion, ops: ScalarOps = FLOAT) -> Quaternion:
        """`a` where the condition holds, else `b`, componentwise."""
        return Quaternion.from_xyzw(*(ops.where(condition, *pair) for pair in zip(a, b)))

    def inverse(self) -> Quaternion:
        """Q⁻¹ = [-q, q0], for a unit quaternion."""
        return Quaternion(-self.vector, self.scalar)

    def to_body(self, v: Vec3) -> Vec3:
        """R(Q) v = (q0² - q·q) v + 2 q (q·v) - 2 q0 (q × v), from inertial to body components (1)."""
        return self._rotate(v, -2.0 * self.scalar)

    def to_inertial(self, v: Vec3) -> Vec3:
        """R(Q)ᵀ v, from body to inertial components: (1) with the sign of its last term flipped."""
        return self._rotate(v, 2.0 * self.scalar)

    def _rotate(self, v: Vec3, c: Scalar) -> Vec3:
        # Written out in components: the law spends a third of its time here.
        q, w = self.vector, self.scalar
        x, y, z, vx, vy, vz = q.x, q.y, q.z, v.x, v.y, v.z
        a = w * w - (x * x + y * y + z * z)
        b = 2.0 * (x * vx + y * vy + z * vz)
        return Vec3(
            a * vx + b * x + c * (y * vz - z * vy),
            a * vy + b * y + c * (z * vx - x * vz),
            a * vz + b * z + c * (x * vy - y * vx),
        )

    def z_axis(self) -> Vec3:
        """R(Q)ᵀ z, the body's z axis in inertial components."""
        q, w = self.vector, self.scalar
        x, y, z = q.x, q.y, q.z
        return Vec3(2.0 * (x * z + w * y), 2.0 * (y * z - w * x), w * w - x * x - y * y + z * z)

    def rate(self, angular_velocity: Vec3) -> Quaternion:
        """dQ/dt for a body-frame angular velocity [rad/s]: ½ [q0 Ω + q × Ω, -q·Ω] (5), (10)."""
        q, w = self.vector, 0.5 * self.scalar
        x, y, z = 0.5 * q.x, 0.5 * q.y, 0.5 * q.z
        a, b, c = angular_velocity.x, angular_velocity.y, angular_velocity.z
        return Quaternion(
            Vec3(w * a + y * c - z * b, w * b + z * a - x * c, w * c + x * b - y * a), -(x * a + y * b + z * c)
        )

    def plus(self, factor: Scalar, other: Quaternion) -> Quaternion:
        """self + factor * other, componentwise."""
        return Quaternion(self.vector.plus(factor, other.vector), self.scalar + factor * other.scalar)

    def norm(self, ops: ScalarOps = FLOAT) -> Scalar:
        """Euclidean length of the four components."""
        return ops.sqrt(self.vector @ self.vector + self.scalar * self.scalar)

    def __truediv__(self, scalar: Scalar) -> Quaternion:
        return Quaternion(self.vector / scalar, self.scalar / scalar)

    def normalised(self, ops: ScalarOps = FLOAT) -> Quaternion:
        """The unit quaternion in this direction; division by zero for a zero quaternion."""
        length = self.norm(ops)
        return Quaternion(self.vector / length, self.scalar / length)

    def unit(self) -> Quaternion:
        """The unit quaternion in this direction, for any floats that are not all zero, however small or large."""
        if not 1e-100 < self.norm() < 1e100:  # its square may not be a float
            largest = max(map(abs, self))
            return Quaternion(self.vector / largest, self.scalar / largest).normalised()
        return self.normalised()

    def __iter__(self) -> Iterator[Scalar]:
        return iter((self.vector.x, self.vector.y, self.vector.z, self.scalar))

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Quaternion):
            return NotImplemented
        return self.vector == other.vector and bool(self.scalar == other.scalar)

    def __hash__(self) -> int:
        return hash((self.vector, self.scalar))

    def __repr__(self) -> str:
        return "Quaternion.from_xyzw({!r}, {!r}, {!r}, {!r})".format(*self)


class Inertia:
    """A symmetric 3x3 matrix J [kg·m²] in the body frame, given by its entries J_ij."""

    __slots__ = ("_columns", "_inverse_columns", "xx", "xy", "xz", "yy", "yz", "zz")

    def __init__(
        self, *, xx: Scalar, yy: Scalar, zz: Scalar, xy: Scalar = 0.0, xz: Scalar = 0.0, yz: Scalar = 0.0
    ) -> None:
        self.xx, self.yy, self.zz = xx, yy, zz
        self.xy, self.xz, self.yz = xy, xz, yz
        x, y, z = self._columns = (Vec3(xx, xy, xz), Vec3(xy, yy, yz), Vec3(xz, yz, zz))
        yxz = y.cross(z)
        determinant = x @ yxz
        # The inverse of a symmetric matrix with columns x, y, z has the columns y×z, z×x, x×y over det.
        self._inverse_columns = (yxz / determinant, z.cross(x) / determinant, x.cross(y) / determinant)

    def __matmul__(self, v: Vec3) -> Vec3:
        """J v."""
        return _combine(self._columns, v)

    def solve(self, v: Vec3) -> Vec3:
        """J⁻¹ v."""
        return _combine(self._inverse_columns, v)

    def __iter__(self) -> Iterator[Scalar]:
        return iter((self.xx, self.yy, self.zz, self.xy, self.xz, self.yz))

    def __repr__(self) -> str:
        return (
            f"Inertia(xx={self.xx!r}, yy={self.yy!r}, zz={self.zz!r}, xy={self.xy!r}, xz={self.xz!r}, yz={self.yz!r})"
        )


def _combine(columns: tuple[Vec3, Vec3, Vec3], v: Vec3) -> Vec3:
    a, b, c = columns
    x, y, z = v.x, v.y, v.z
    return Vec3(
        a.x * x + b.x * y + c.x * z,
        a.y * x + b.y * y + c.y * z,
        a.z * x + b.z * y + c.z * z,
    )


def is_positive_definite(xx: float, yy: float, zz: float, xy: float, xz: float, yz: float) -> bool:
    """Whether the symmetric matrix of these entries is positive definite: all leading principal minors are positive."""
    determinant = xx * (yy * zz - yz * yz) - xy * (xy * zz - yz * xz) + xz * (xy * yz - yy * xz)
    return xx > 0.0 and xx * yy - xy * xy > 0.0 and determinant > 0.0
