"""What every tool flies: the same FMUs, parameters, step and end, and the signals that are compared."""

import json
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TypeAlias

from orchestration.system.model import Parameter
from orchestration.wiring import COMMAND, MEASUREMENT

SIGNALS = (*(f"plant.{name}" for name in MEASUREMENT), *(f"controller.{name}" for name in COMMAND))
"""Columns of a tool's record beside the time."""

CONNECTIONS = (
    *((("plant", name), ("controller", name)) for name in MEASUREMENT),
    *((("controller", name), ("plant", name)) for name in COMMAND),
)
"""(element, output) to (element, input), all Real."""

Rows: TypeAlias = list[list[float]]
"""The time at the end of each step and the values of `SIGNALS` then; NaN: the tool flies without that component."""


@dataclass(frozen=True, kw_only=True)
class Job:
    """One flight for a tool to fly."""

    controller: Path
    plant: Path
    ssp: Path
    """the same system as an SSP"""
    step: float
    """communication step of both FMUs [s]"""
    stop: float
    """[s]"""
    parameters: dict[str, dict[str, Parameter]]
    """by component, as the SSP has them"""
    recorded: Path
    """a flight of this project's master, as .npy: time and `SIGNALS` at the start of each step"""
    folder: Path
    """for what the tool writes"""

    @property
    def steps(self) -> int:
        """Number of communication steps."""
        return round(self.stop / self.step)

    @property
    def fmus(self) -> dict[str, Path]:
        """By component, the controller first."""
        return {"controller": self.controller, "plant": self.plant}

    def to_json(self) -> str:
        """For a process of its own, which need not know this package: signals and connections are in it."""
        return json.dumps({**asdict(self), "signals": SIGNALS, "connections": CONNECTIONS}, default=str)

    @classmethod
    def from_json(cls, text: str) -> "Job":
        """What `to_json` gave."""
        given = json.loads(text)
        del given["signals"], given["connections"]
        paths = {name: Path(given[name]) for name in ("controller", "plant", "ssp", "recorded", "folder")}
        return cls(**{**given, **paths})
