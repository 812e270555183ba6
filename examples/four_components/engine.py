"""An engine, which follows what is asked of it."""

from fmu_kit.slave import Slave
from fmu_kit.variables import continuous_input, discrete_output, fixed_parameter


class Engine(Slave):
    """The force moves to what is asked, no faster than `rate_max`."""

    variables = (
        continuous_input("asked", "force", "N"),
        discrete_output("force", "at the wheels", "N"),
        fixed_parameter("rate_max", "largest change of the force", "N/s", 5000.0, above=0.0),
        fixed_parameter("initial.force", "force(0)", "N", 800.0),
    )
    description = "Engine: force asked in, force out"
    initial_outputs_depend_on_inputs = False

    def initialise(self, t: float) -> None:
        """Start at the initial force."""
        self.put("force", self.real("initial.force"))

    def step(self, t: float, h: float) -> None:
        """Sample; `h` is the time until the next one."""
        most = self.real("rate_max") * h
        self.put("force", self.real("force") + min(max(self.real("asked") - self.real("force"), -most), most))
