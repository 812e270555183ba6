"""One flight for a tool to fly, as its process is told of it: it imports nothing that takes time to load."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, TypeAlias

if TYPE_CHECKING:
    from orchestration.system.component import Parameter

End: TypeAlias = tuple[str, str]
"""Component and variable"""

Rows: TypeAlias = list[list[float]]
"""The time at the end of each step and the values of the signals then; NaN: the tool flies without that component."""


@dataclass(frozen=True, kw_only=True)
class Job:
    """One flight for a tool to fly."""

    fmus: dict[str, Path]
    """by component, in the order of the loop"""
    ssp: Path
    """the same system as an SSP"""
    step: float
    """communication step of all [s]"""
    stop: float
    """[s]"""
    parameters: dict[str, dict[str, Parameter]]
    """by component, as the SSP has them"""
    connections: tuple[tuple[End, End], ...]
    signals: tuple[str, ...]
    """see `assignment.Loop`"""
    recorded: Path
    """a flight of this project's master, as .npy: time and signals at the start of each step"""
    folder: Path
    """for what the tool writes"""

    @property
    def steps(self) -> int:
        """Number of communication steps."""
        return round(self.stop / self.step)

    def to_json(self) -> str:
        """For a process of its own, which need not know this package."""
        return json.dumps(asdict(self), default=str)

    @classmethod
    def from_json(cls, text: str) -> Job:
        """What `to_json` gave."""
        given = json.loads(text)
        paths = {name: Path(given[name]) for name in ("ssp", "recorded", "folder")}
        connections = tuple((tuple(start), tuple(end)) for start, end in given["connections"])
        fmus = {name: Path(path) for name, path in given["fmus"].items()}
        return cls(**{**given, **paths, "fmus": fmus, "connections": connections, "signals": tuple(given["signals"])})
