"""Names of a flight that other rooms use."""

from orchestration.quadrotor.scenarios.wiring import COMMAND, POSITION, POSITION_REFERENCE

KIND = "flight"
"""Kind of request of a `Scenario`"""
FIGURES = ("path", "errors", "components", "commands", "energy", "phase", "spectrum")
NEEDED = frozenset((*POSITION_REFERENCE, *(f"plant.{name}" for name in (*POSITION, *COMMAND))))
"""Columns by which a run of any system gets the figures of a flight"""
