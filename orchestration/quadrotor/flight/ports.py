"""The variables that a controller and a plant need to be connected, with the names and units of the wiring."""

from collections.abc import Iterable, Iterator

from orchestration.components.checks.validation.roles import Port, Role
from orchestration.components.fmi.kit import SAMPLE_OFFSET, SAMPLE_PERIOD, TRAJECTORY, USE_REFERENCE_INPUTS
from orchestration.quadrotor.scenarios import wiring


def _ports(causality: str, names: Iterable[str]) -> Iterator[Port]:
    for name in names:
        yield Port(name, causality, wiring.UNITS.get(name))


CONTROLLER = Role(
    identified_by=wiring.COMMAND,
    ports=(
        *_ports("output", wiring.COMMAND),
        *_ports("input", wiring.MEASUREMENT),
    ),
    optional=(
        *_ports("input", wiring.REFERENCE),
        *_ports("parameter", (SAMPLE_PERIOD, SAMPLE_OFFSET, *TRAJECTORY)),
        Port(USE_REFERENCE_INPUTS, "parameter", None, "Boolean"),
    ),
    complete_by=(*TRAJECTORY,),
)
PLANT = Role(
    identified_by=wiring.MEASUREMENT,
    ports=(
        *_ports("output", wiring.MEASUREMENT),
        *_ports("input", (*wiring.COMMAND, *wiring.EXTERNAL_FORCE)),
    ),
)
