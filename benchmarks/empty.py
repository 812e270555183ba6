"""Slaves with the variables of the real ones that compute nothing, which measure the overhead of pythonfmu and fmpy."""

from controller_fmu.sliding_mode.slave import UnifiedController
from fmu_kit.saved_state import State
from plant_fmu.slave import QuadrotorPlant


class EmptyPlant(QuadrotorPlant):
    """The plant's variables, no dynamics."""

    description = "The plant's variables, no dynamics"

    def read_parameters(self) -> None:
        """Nothing to read."""

    def initialise(self, t: float) -> None:
        """Nothing to compute."""

    def step(self, t: float, h: float) -> None:
        """Nothing to integrate."""

    def internal_state(self) -> State:
        """No state."""
        return {}


class EmptyController(UnifiedController):
    """The controller's variables, no law."""

    description = "The controller's variables, no law"

    def read_parameters(self) -> None:
        """Nothing to read."""

    def initialise(self, t: float) -> None:
        """Nothing to compute."""

    def step(self, t: float, h: float) -> None:
        """Nothing to evaluate."""

    def internal_state(self) -> State:
        """No state."""
        return {}
