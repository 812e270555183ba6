"""The figures of a flight by name."""

from orchestration.quadrotor.flight.commands import commands, spectrum
from orchestration.quadrotor.flight.errors import components_of_errors, errors
from orchestration.quadrotor.flight.path import path
from orchestration.quadrotor.flight.sliding import energy, phase
from orchestration.simulation.figures.views import Drawing

DRAWING = Drawing(
    makers={
        "path": path,
        "errors": errors,
        "components": components_of_errors,
        "commands": commands,
        "energy": energy,
        "phase": phase,
        "spectrum": spectrum,
    },
    columns=lambda system, described: described.keys(),
)
