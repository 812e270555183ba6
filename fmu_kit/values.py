"""The values of a slave's variables by their names."""

from fmu_kit.algebra import Inertia, Quaternion, Vec3, is_positive_definite
from fmu_kit.errors import require
from fmu_kit.variables import INERTIA_AXES


class Values:
    """What a slave reads and sets where its variables are a list; an attribute may have the name of a method here."""

    _index: dict[str, int]
    """the place of each variable, Reals first"""
    _reals: list[float]
    _others: dict[int, int | bool]
    """all but Reals, by place"""

    def real(self, name: str) -> float:
        """The value of a Real variable."""
        return self._reals[self._index[name]]

    def boolean(self, name: str) -> bool:
        """The value of a Boolean variable."""
        return bool(self._others[self._index[name]])

    def vec3(self, name: str) -> Vec3:
        """The values of `name.x`, `.y`, `.z`."""
        i, reals = self._index[name + ".x"], self._reals
        return Vec3(reals[i], reals[i + 1], reals[i + 2])

    def quaternion(self, name: str) -> Quaternion:
        """The values of `name.x`, `.y`, `.z`, `.w`."""
        i, reals = self._index[name + ".x"], self._reals
        return Quaternion(Vec3(reals[i], reals[i + 1], reals[i + 2]), reals[i + 3])

    def inertia(self) -> Inertia:
        """The matrix of `inertia.xx` to `.yz`; raises `FmuError` unless it is positive definite."""
        entries = {axis: self.real(f"inertia.{axis}") for axis in INERTIA_AXES}
        listed = ", ".join(f"{axis} {value:g}" for axis, value in entries.items())
        require(is_positive_definite(**entries), "inertia.{xx,yy,zz,xy,xz,yz}", listed, "a positive definite matrix")
        return Inertia(**entries)

    def enumeration(self, name: str) -> int:
        """The value of an Enumeration: to be compared with the members of its `IntEnum`."""
        return int(self._others[self._index[name]])

    def put(self, name: str, value: float) -> None:
        """Set a Real variable."""
        self._reals[self._index[name]] = value

    def count(self, name: str) -> int:
        """The value of an Integer variable."""
        return int(self._others[self._index[name]])

    def put_count(self, name: str, value: int) -> None:
        """Set an Integer variable."""
        self._others[self._index[name]] = value

    def put_boolean(self, name: str, value: bool) -> None:
        """Set a Boolean variable."""
        self._others[self._index[name]] = value

    def put_vec3(self, name: str, v: Vec3) -> None:
        """Set `name.x`, `.y`, `.z`."""
        i = self._index[name + ".x"]
        self._reals[i : i + 3] = (v.x, v.y, v.z)

    def put_quaternion(self, name: str, q: Quaternion) -> None:
        """Set `name.x`, `.y`, `.z`, `.w`."""
        i, v = self._index[name + ".x"], q.vector
        self._reals[i : i + 4] = (v.x, v.y, v.z, q.scalar)
