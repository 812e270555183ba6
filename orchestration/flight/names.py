"""Names by which a flight is known elsewhere."""

from orchestration.quadrotor.wiring import COMMAND, POSITION, POSITION_REFERENCE

KIND = "flight"
"""That of a `Scenario`"""
FIGURES = ("path", "errors", "components", "commands", "energy", "phase", "spectrum")
NEEDED = frozenset((*POSITION_REFERENCE, *(f"plant.{name}" for name in (*POSITION, *COMMAND))))
"""Columns that make a flight of a run of any system"""
