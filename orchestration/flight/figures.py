"""The figures of a flight by name, and the columns that they read."""

from orchestration.figures.views import Drawing
from orchestration.flight import phase
from orchestration.flight.commands import COLUMNS, commands
from orchestration.flight.energy import COLUMN, energy
from orchestration.flight.errors import DRAWN, components_of_errors, errors
from orchestration.flight.names import FIGURES
from orchestration.flight.path import path
from orchestration.flight.spectrum import spectrum
from orchestration.quadrotor.wiring import POSITION, POSITION_REFERENCE

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
