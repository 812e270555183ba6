"""An inertial unit with a compass, and a satellite receiver: their measurements without noise."""

from fmu_kit.algebra import ZERO, Quaternion, Vec3
from fmu_kit.interface import Input, Local, Output, Parameter
from fmu_kit.slave import Slave


class InertialUnit(Slave):
    """Accelerometer, gyroscope and compass: motion in, what is felt in the body out.

    The specific force is the mean since the last sample, as units that sum up velocity have it.
    """

    velocity = Input("true velocity: north, east, down", "m/s", ZERO)
    quaternion = Input("true attitude, scalar last", "1", Quaternion(ZERO, 1.0))
    rate = Input("true angular velocity, about the body's axes", "rad/s", ZERO)

    specific_force = Output("specific force in the body: what an accelerometer feels", "m/s2", Vec3(0.0, 0.0, -9.81))
    angular_velocity = Output("angular velocity about the body's axes", "rad/s", ZERO)
    north = Output("direction of north in the body", "1", Vec3(1.0, 0.0, 0.0))

    force_bias = Parameter("constant error of the accelerometer", "m/s2", ZERO)
    rate_bias = Parameter("constant error of the gyroscope", "rad/s", ZERO)
    gravity = Parameter("gravity of the place", "m/s2", 9.81)
    last_velocity = Local("velocity at the last sample", "m/s", ZERO)
    last_quaternion = Local("attitude at the last sample", "1", Quaternion(ZERO, 1.0))

    def initialise(self, t: float) -> None:
        """Measure at rest until the first sample."""
        self._measure(ZERO, self.quaternion.unit())

    def step(self, t: float, h: float) -> None:
        """Sample: the mean specific force since the last one."""
        attitude, last = self.quaternion.unit(), self.last_quaternion.unit()
        middle = Quaternion(attitude.vector + last.vector, attitude.scalar + last.scalar).unit()
        self._measure((self.velocity - self.last_velocity) / h if t > 0.0 else ZERO, middle)

    def _measure(self, acceleration: Vec3, attitude: Quaternion) -> None:
        force = attitude.to_body(acceleration - Vec3(0.0, 0.0, self.gravity))
        self.specific_force = force + self.force_bias
        self.angular_velocity = self.rate + self.rate_bias
        self.north = self.quaternion.unit().to_body(Vec3(1.0, 0.0, 0.0))
        self.last_velocity, self.last_quaternion = self.velocity, self.quaternion


class Receiver(Slave):
    """A receiver of satellites: each sample is a fix of position and velocity."""

    true_position = Input("true position: north, east, down", "m", ZERO)
    true_velocity = Input("true velocity: north, east, down", "m/s", ZERO)
    position = Output("measured position: north, east, down", "m", ZERO)
    velocity = Output("measured velocity: north, east, down", "m/s", ZERO)
    fix = Output("number of fixes so far", "1", 0.0)

    initial_outputs_depend_on_inputs = False

    def step(self, t: float, h: float) -> None:
        """Sample."""
        self.position, self.velocity, self.fix = self.true_position, self.true_velocity, self.fix + 1.0
