"""A controller behind its own sample clock: what the FMUs of all controllers do, whatever their law."""

from abc import abstractmethod

from controller_fmu.sample_clock import SampleClock
from controller_fmu.vehicle import Measurement, Model
from fmu_kit.authors import AUTHOR, LICENSE
from fmu_kit.errors import require
from fmu_kit.saved_state import State
from fmu_kit.slave import Slave
from fmu_kit.trajectory import Reference, Trajectory

SHORTEST_PERIOD = 1e-9
"""[s]; sample times further apart than a nanosecond stay distinct floats for days"""


class SampledController(Slave):
    """Evaluates a law when a sample is due, and holds its command: laws define `read_gains` and `control`.

    Their variables are those of `controller_fmu.interface` and what they add.
    """

    author, license = AUTHOR, LICENSE
    initial_outputs_depend_on_inputs = True
    initially_idle = frozenset({"sample_offset"})

    @abstractmethod
    def read_gains(self) -> None:
        """Take over the parameters of the law."""

    @abstractmethod
    def control(self, measurement: Measurement, reference: Reference) -> None:
        """Evaluate the law and write its command and locals."""

    def read_parameters(self) -> None:
        """Build the nominal model, the trajectory and the law; check the clock."""
        self._model = Model(mass=self.real("mass"), inertia=self.inertia(), gravity=self.real("gravity"))
        self.read_gains()
        self._trajectory = Trajectory(
            amplitude_x=self.real("trajectory.amplitude_x"),
            amplitude_y=self.real("trajectory.amplitude_y"),
            frequency=self.real("trajectory.frequency"),
            start_z=self.real("trajectory.start_z"),
            rate_z=self.real("trajectory.rate_z"),
        )
        period = self.real("sample_period")
        require(
            period == 0.0 or period >= SHORTEST_PERIOD, "sample_period", period, f"0 or at least {SHORTEST_PERIOD} s"
        )
        self._use_reference_inputs = self.boolean("use_reference_inputs")

    def initialise(self, t: float) -> None:
        """Hold the command for the initial inputs; this is not a sample."""
        self._clock = SampleClock(self.real("sample_period"), self.real("sample_offset"))
        self._clock.start(t)
        self.sample(t, 0.0)

    def step(self, t: float, h: float) -> None:
        """Sample at `t` if it is time, and hold over [t, t + h]."""
        period = self._clock.period
        if h > period * (1.0 + 1e-6) and period > 0.0:
            self.warn_once(
                "long step", f"communication step {h} s is longer than sample_period {period} s: one sample a step"
            )
        if self._clock.is_due(t):
            self.sample(t, h)
            self.put_count("sample_count", self.count("sample_count") + 1)

    def internal_state(self) -> State:
        """The clock; the held command and the count are among the variables."""
        return {"next_index": self._clock.next_index}

    def restore(self, state: State) -> None:
        """Put the clock back."""
        self._clock = SampleClock(self.real("sample_period"), self.real("sample_offset"), int(state["next_index"]))

    def sample(self, t: float, h: float) -> None:
        """Hold a command for what is measured at `t`, over [t, t + h]; of no length at initialisation."""
        quaternion = self.quaternion("quaternion")
        if not any(quaternion):
            self._hover()
            return
        measurement = Measurement(
            self.vec3("position"),
            self.vec3("velocity"),
            quaternion.unit(),
            self.vec3("angular_velocity"),
        )
        self.respond(t, h, measurement)

    def respond(self, t: float, h: float, measurement: Measurement) -> None:
        """Write the command for a measurement at `t`, and the locals."""
        self.control(measurement, self._reference(t))

    def _reference(self, t: float) -> Reference:
        if not self._use_reference_inputs:
            return self._trajectory.at(t)
        return Reference(
            position=self.vec3("reference.position"),
            velocity=self.vec3("reference.velocity"),
            acceleration=self.vec3("reference.acceleration"),
            jerk=self.vec3("reference.jerk"),
            snap=self.vec3("reference.snap"),
        )

    def _hover(self) -> None:
        """A zero quaternion means that nothing is connected yet."""
        self.warn_once(
            "no measurement", "quaternion = (0, 0, 0, 0): no measurement, commanding hover thrust and no torque"
        )
        self.put("thrust", self._model.mass * self._model.gravity)
        for axis in "xyz":
            self.put(f"torque.{axis}", 0.0)
