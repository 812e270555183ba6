"""An extended Kalman filter for position, velocity and attitude, in terms of the error of its estimate."""

from fmu_kit.algebra import ZERO, Quaternion, Vec3
from fmu_kit.interface import Input, Local, Parameter, State
from fmu_kit.saved_state import State as Saved
from fmu_kit.slave import Slave

Matrix = list[list[float]]
SIZE = 9
"""errors of position and velocity, inertial, and of the attitude, as a small rotation about the body's axes"""


class KalmanFilter(Slave):
    """Extended Kalman filter: inertial unit, compass and receiver in, motion out."""

    specific_force = Input("measured specific force in the body", "m/s2", Vec3(0.0, 0.0, -9.81))
    rate = Input("measured angular velocity, about the body's axes", "rad/s", ZERO)
    north = Input("measured direction of north in the body", "1", Vec3(1.0, 0.0, 0.0))
    fix_position = Input("position of the receiver", "m", ZERO)
    fix_velocity = Input("velocity of the receiver", "m/s", ZERO)
    fix = Input("number of fixes so far", "1", 0.0)

    position = State("estimated position: north, east, down", "m", ZERO)
    velocity = State("estimated velocity: north, east, down", "m/s", ZERO)
    quaternion = State("estimated attitude, scalar last", "1", Quaternion(ZERO, 1.0))
    angular_velocity = State("measured angular velocity, about the body's axes", "rad/s", ZERO)
    last_fix = Local("number of the last fix taken", "1", 0.0)

    force_noise = Parameter("standard deviation of a sample of the force", "m/s2", 0.1, above=0.0)
    rate_noise = Parameter("standard deviation of a sample of the rate", "rad/s", 0.01, above=0.0)
    north_noise = Parameter("standard deviation of a sample of north", "1", 0.02, above=0.0)
    position_noise = Parameter("standard deviation of the position of a fix", "m", 0.5, above=0.0)
    velocity_noise = Parameter("standard deviation of the velocity of a fix", "m/s", 0.05, above=0.0)
    position_deviation = Parameter("standard deviation of the position at the start", "m", 0.5, above=0.0)
    velocity_deviation = Parameter("standard deviation of the velocity at the start", "m/s", 0.1, above=0.0)
    attitude_deviation = Parameter("standard deviation of the attitude at the start", "rad", 0.05, above=0.0)
    gravity = Parameter("gravity of the place", "m/s2", 9.81)

    initial_outputs_depend_on_inputs = False

    def initialise(self, t: float) -> None:
        """Set the initial covariance."""
        deviations = (self.position_deviation, self.velocity_deviation, self.attitude_deviation)
        self._P = [[deviations[i // 3] ** 2 if i == j else 0.0 for j in range(SIZE)] for i in range(SIZE)]

    def internal_state(self) -> Saved:
        """The covariance."""
        return {"covariance": self._P}

    def restore(self, state: Saved) -> None:
        """Restore the covariance."""
        self._P = [[float(each) for each in row] for row in state["covariance"]]

    def step(self, t: float, h: float) -> None:
        """Sample: predict from the last one, then correct by the compass and by a new fix."""
        if t > 0.0:
            self._predict(0.5 * (self.angular_velocity + self.rate), h)
        self.angular_velocity = self.rate
        expected = self.quaternion.to_body(Vec3(1.0, 0.0, 0.0))
        compass = [[*_NONE, *_NONE, *row] for row in _cross(expected)]
        error = self._corrected([0.0] * SIZE, compass, self.north - expected, self.north_noise)
        if self.fix > self.last_fix:
            residual = self.fix_position - self.position
            error = self._corrected(error, [[*row, *_NONE, *_NONE] for row in _AXES], residual, self.position_noise)
            residual = self.fix_velocity - self.velocity
            error = self._corrected(error, [[*_NONE, *row, *_NONE] for row in _AXES], residual, self.velocity_noise)
            self.last_fix = self.fix
        self.position = self.position + Vec3(*error[0:3])
        self.velocity = self.velocity + Vec3(*error[3:6])
        self.quaternion = (self.quaternion * Quaternion(0.5 * Vec3(*error[6:9]), 1.0)).unit()

    def _predict(self, rate: Vec3, h: float) -> None:
        """Strapdown integration over `h` [s], and propagation of the covariance."""
        turn = Quaternion(0.5 * h * rate, 1.0).unit()
        half = (self.quaternion * Quaternion(0.25 * h * rate, 1.0)).unit()
        acceleration = half.to_inertial(self.specific_force) + Vec3(0.0, 0.0, self.gravity)
        self.position = self.position + h * (self.velocity + 0.5 * h * acceleration)
        self.velocity = self.velocity + h * acceleration
        self.quaternion = (self.quaternion * turn).unit()
        columns = [half.to_inertial(column) for column in map(self.specific_force.cross, _AXES)]
        rotated = [[*row] for row in zip(*columns)]
        turned = _cross(rate)
        F = [[1.0 if i == j else 0.0 for j in range(SIZE)] for i in range(SIZE)]
        for i in range(3):
            F[i][3 + i] = h
            for j in range(3):
                F[3 + i][6 + j] = -h * rotated[i][j]
                F[6 + i][6 + j] -= h * turned[i][j]
        half_way = [[sum(F[i][k] * self._P[k][j] for k in range(SIZE)) for j in range(SIZE)] for i in range(SIZE)]
        self._P = [[sum(half_way[i][k] * F[j][k] for k in range(SIZE)) for j in range(SIZE)] for i in range(SIZE)]
        for i in range(3):
            self._P[3 + i][3 + i] += (h * self.force_noise) ** 2
            self._P[6 + i][6 + i] += (h * self.rate_noise) ** 2

    def _corrected(self, error: list[float], rows: Matrix, residual: Vec3, noise: float) -> list[float]:
        """The estimated errors after three scalar measurements in turn: `rows` times the errors, with noise."""
        for row, measured in zip(rows, residual):
            gain = [sum(row[j] * self._P[i][j] for j in range(SIZE)) for i in range(SIZE)]
            variance = sum(row[j] * gain[j] for j in range(SIZE)) + noise**2
            innovation = (measured - sum(row[j] * error[j] for j in range(SIZE))) / variance
            error = [error[i] + gain[i] * innovation for i in range(SIZE)]
            self._P = [[self._P[i][j] - gain[i] * gain[j] / variance for j in range(SIZE)] for i in range(SIZE)]
        return error


_NONE = (0.0, 0.0, 0.0)
_AXES = (Vec3(1.0, 0.0, 0.0), Vec3(0.0, 1.0, 0.0), Vec3(0.0, 0.0, 1.0))


def _cross(a: Vec3) -> Matrix:
    """The matrix [a]×."""
    return [[0.0, -a.z, a.y], [a.z, 0.0, -a.x], [-a.y, a.x, 0.0]]
