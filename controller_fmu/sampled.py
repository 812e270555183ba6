"""A controller with its own sample clock: the common part of all controller FMUs."""

import math
from abc import abstractmethod
from dataclasses import dataclass
from types import MappingProxyType

from controller_fmu.interface import ControllerInterface
from controller_fmu.vehicle import Measurement, Model
from fmu_kit.algebra import ZERO
from fmu_kit.authors import AUTHOR, LICENSE
from fmu_kit.errors import require
from fmu_kit.interface import read_fields
from fmu_kit.mixer import Mixer, Thrusts
from fmu_kit.rigid_body import Wrench
from fmu_kit.saved_state import State
from fmu_kit.trajectory import Reference, Trajectory

TOLERANCE = 1e-6
"""Relative to a period: masters accumulate time, and some end with a step of 1e-13 s."""
ROUNDING = 1e-9
"""Relative to a time, for the same reason, where there is no period"""


@dataclass(slots=True)
class SampleClock:
    """Due times offset + k·period, k = 0, 1, …; a sample is taken at the first communication point from then on."""

    period: float
    """Period [s]; 0: every communication point from the offset on is a sample"""
    offset: float
    """Offset [s]"""
    next_index: int = 0
    """k of the next due time"""

    def start(self, t: float) -> None:
        """Begin at `t` [s]: due times before it are past."""
        if self.period > 0.0:
            self.next_index = max(0, math.ceil((t - self.offset) / self.period - TOLERANCE))

    def is_due(self, t: float) -> bool:
        """Whether a sample is due at the communication point `t` [s]; if so, the clock moves on to the next."""
        if self.period == 0.0:
            return t >= self.offset * (1.0 - ROUNDING)
        elapsed = (t - self.offset) / self.period + TOLERANCE
        if elapsed < self.next_index:
            return False
        self.next_index = math.floor(elapsed) + 1
        return True


SHORTEST_PERIOD = 1e-9
"""Shortest period [s]; sample times further apart than a nanosecond stay distinct floats for days"""


class SampledController(ControllerInterface):
    """Evaluates a law when a sample is due, and holds its command: laws define `control`."""

    author, license = AUTHOR, LICENSE
    initial_outputs_depend_on_inputs = True
    initially_idle = frozenset({"sample_offset"})
    usual_parameters = MappingProxyType({"sample_period": 0.0})  # the master's clock decides when it samples

    @abstractmethod
    def control(self, measurement: Measurement, reference: Reference) -> None:
        """Evaluate the law and write its command and locals."""

    def read_parameters(self) -> None:
        """Build the nominal model and the trajectory, and check the clock; laws add their own parameters."""
        self._model = read_fields(self, Model)
        self._trajectory = read_fields(self, Trajectory, "trajectory_")
        self._mixer = read_fields(self, Mixer, "motor_")
        period = self.sample_period
        require(
            period == 0.0 or period >= SHORTEST_PERIOD, "sample_period", period, f"0 or at least {SHORTEST_PERIOD} s"
        )

    def initialise(self, t: float) -> None:
        """Hold the command for the initial inputs; this is not a sample."""
        self._clock = SampleClock(self.sample_period, self.sample_offset)
        self._clock.start(t)
        self._hold(t, 0.0)

    def step(self, t: float, h: float) -> None:
        """Sample at `t` if a sample is due, and hold over [t, t + h]."""
        period = self._clock.period
        if h > period * (1.0 + 1e-6) and period > 0.0:
            self.warn_once(
                "long step", f"communication step {h} s is longer than sample_period {period} s: one sample a step"
            )
        if self._clock.is_due(t):
            self._hold(t, h)
            self.sample_count = self.sample_count + 1

    def internal_state(self) -> State:
        """The clock; the held command and the count are among the variables."""
        return {"next_index": self._clock.next_index}

    def restore(self, state: State) -> None:
        """Restore the clock."""
        self._clock = SampleClock(self.sample_period, self.sample_offset, int(state["next_index"]))

    def _hold(self, t: float, h: float) -> None:
        """Sample, and set the thrusts of the motors for the command."""
        self.sample(t, h)
        self.motor_thrust = self._mixed(Wrench(self.thrust, self.torque))

    def _mixed(self, command: Wrench) -> Thrusts:
        mixer = self._mixer
        if min(mixer.arm_x, mixer.arm_y, mixer.drag_to_thrust) > 0.0:
            return mixer.thrusts(command)
        return Thrusts(0.0, 0.0, 0.0, 0.0)

    def sample(self, t: float, h: float) -> None:
        """Hold a command for the measurement at `t`, over [t, t + h]; h = 0 at initialisation."""
        quaternion = self.quaternion
        if not any(quaternion):
            self._hover()
            return
        self.respond(t, h, Measurement(self.position, self.velocity, quaternion.unit(), self.angular_velocity))

    def respond(self, t: float, h: float, measurement: Measurement) -> None:
        """Write the command for a measurement at `t`, and the locals."""
        self.control(measurement, self._reference(t))

    def _reference(self, t: float) -> Reference:
        if not self.use_reference_inputs:
            return self._built_in(t)
        return read_fields(self, Reference, "reference_")

    def _built_in(self, t: float) -> Reference:
        """The built-in trajectory, whose parameters are in the axes convention of the FMU."""
        built_in = self._trajectory.at(t)
        return built_in if self.is_turned is False else built_in.turned(self.is_turned)

    def _hover(self) -> None:
        """Command hover: a zero quaternion means that nothing is connected yet."""
        self.warn_once(
            "no measurement", "quaternion = (0, 0, 0, 0): no measurement, commanding hover thrust and no torque"
        )
        self.thrust, self.torque = self._model.mass * self._model.gravity, ZERO
