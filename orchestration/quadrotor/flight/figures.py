"""The figures of a flight by name, and the columns that they read."""

from orchestration.quadrotor.flight import phase
from orchestration.quadrotor.flight.commands import COLUMNS, commands
from orchestration.quadrotor.flight.energy import COLUMN, energy
from orchestration.quadrotor.flight.errors import DRAWN, components_of_errors, errors
from orchestration.quadrotor.flight.names import FIGURES
from orchestration.quadrotor.flight.path import path
from orchestration.quadrotor.flight.spectrum import spectrum
from orchestration.quadrotor.scenarios.wiring import POSITION, POSITION_REFERENCE
from orchestration.simulation.figures.views import Drawing

_READ = {
    "time", *POSITION_REFERENCE, *(f"plant.{name}" for name in POSITION), *COLUMNS, COLUMN, *DRAWN, *phase.DRAWN,
}  # fmt: skip
DRAWING = Drawing(
    makers=dict(
        zip(
            FIGURES,
            (path, errors, components_of_errors, commands, energy, phase.phase, spectrum),
            strict=True,
        )
    ),
    columns=lambda system, described: _READ,
)
