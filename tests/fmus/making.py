"""The two ways to make an FMU of a slave, and how their FMUs may differ."""

from dataclasses import dataclass

from orchestration.components.building.models import MODELS
from orchestration.quadrotor.scenarios.wiring import DEFAULT_CONTROLLER, DEFAULT_PLANT

PAIR = {name: MODELS[name] for name in (DEFAULT_CONTROLLER, DEFAULT_PLANT)}
"""One controller and one plant: what every slave does by its base, and what a packing does to any, is shown with them.

What is an FMU's own (interface, documentation, native build) is looked at in each of `MODELS`.
"""


@dataclass(frozen=True, kw_only=True)
class Making:
    """What differs on purpose between the FMUs of one slave."""

    native: bool
    failure: int
    """the status of FMI with which a call fails"""
    traceback: bool
    """whether a failure tells more than its line"""
    state_is_refused_by: str
    """the call that refuses what is no state of the FMU"""
    slaves: int
    """instances of the slave's class in the process, for each instance of the FMU"""
    kilobytes: float
    """what an instance may leave behind in the process; pythonfmu leaks the class that it makes for each"""


MAKINGS = {
    "python": Making(
        native=False,
        failure=4,
        traceback=True,
        state_is_refused_by="fmi2SetFMUstate",
        slaves=1,
        kilobytes=16.0,
    ),
    "native": Making(
        native=True,
        failure=3,
        traceback=False,
        state_is_refused_by="fmi2DeSerializeFMUstate",
        slaves=0,
        kilobytes=4.0,
    ),
}
