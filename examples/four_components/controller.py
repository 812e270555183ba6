"""A cruise controller."""

from fmu_kit.slave import Slave
from fmu_kit.variables import continuous_input, discrete_local, discrete_output, fixed_parameter, tunable_parameter


class CruiseController(Slave):
    """PI with an integral that stops where the engine is at its limit."""

    variables = (
        continuous_input("speed", "measured", "m/s"),
        continuous_input("set_speed", "desired", "m/s"),
        discrete_output("force", "asked of the engine", "N"),
        discrete_local("integral", "part of the force, after the last sample", "N"),
        tunable_parameter("k_p", "gain of the error", "N.s/m", 1200.0),
        tunable_parameter("k_i", "gain of its integral", "N/m", 300.0),
        fixed_parameter("force_max", "that the engine has", "N", 4000.0, above=0.0),
        fixed_parameter("initial.force", "force before the first sample, and integral(0)", "N", 800.0),
    )
    description = "Cruise controller: speed in, force out"
    initial_outputs_depend_on_inputs = False

    def initialise(self, t: float) -> None:
        """Ask for the initial force."""
        self.put("force", self.real("initial.force"))
        self.put("integral", self.real("initial.force"))

    def step(self, t: float, h: float) -> None:
        """Sample; `h` is the time until the next one."""
        error = self.real("set_speed") - self.real("speed")
        wanted = self.real("k_p") * error + self.real("integral")
        force = min(max(wanted, 0.0), self.real("force_max"))
        if force == wanted:
            self.put("integral", self.real("integral") + self.real("k_i") * h * error)
        self.put("force", force)
