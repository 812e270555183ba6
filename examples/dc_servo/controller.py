"""A PID controller as it is programmed."""

from fmu_kit.saved_state import State
from fmu_kit.slave import Slave
from fmu_kit.variables import continuous_input, discrete_local, discrete_output, fixed_parameter


class PidController(Slave):
    """Integral by forward Euler, derivative of the output by backward difference with a filter."""

    variables = (
        continuous_input("angle", "measured", "rad"),
        continuous_input("reference", "desired angle", "rad"),
        discrete_output("u", "command", "V"),
        discrete_local("integral", "part of the command, after the last sample", "V"),
        discrete_local("derivative", "part of the command at the last sample", "V"),
        fixed_parameter("K", "gain", "V/rad", 0.96),
        fixed_parameter("Ti", "integral time", "s", 0.12, above=0.0),
        fixed_parameter("Td", "derivative time", "s", 0.049, minimum=0.0),
        fixed_parameter("N", "largest gain of the derivative, over K", "1", 10.0, above=0.0),
        fixed_parameter("period", "h for which the controller is programmed", "s", 0.006, above=0.0),
    )
    description = "PID controller: angle in, command out"
    initial_outputs_depend_on_inputs = False

    def initialise(self, t: float) -> None:
        """At rest until the first sample."""
        self._angle = self.real("angle")

    def step(self, t: float, h: float) -> None:
        """Sample: command first, then what the next one needs."""
        K, Td, N, period = (self.real(name) for name in ("K", "Td", "N", "period"))
        angle, error = self.real("angle"), self.real("reference") - self.real("angle")
        derivative = (Td * self.real("derivative") - K * Td * N * (angle - self._angle)) / (Td + N * period)
        self.put("u", K * error + self.real("integral") + derivative)
        self.put("integral", self.real("integral") + K * period / self.real("Ti") * error)
        self.put("derivative", derivative)
        self._angle = angle

    def internal_state(self) -> State:
        """The angle before."""
        return {"angle": self._angle}

    def restore(self, state: State) -> None:
        """Put it back."""
        self._angle = float(state["angle"])
