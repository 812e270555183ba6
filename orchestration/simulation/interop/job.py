"""A run for a tool, as passed to its process: this module imports nothing that takes time to load."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, TypeAlias

if TYPE_CHECKING:
    from orchestration.systems.system.component import Parameter

End: TypeAlias = tuple[str, str]
"""Component and variable"""

Rows: TypeAlias = list[list[float]]
"""The time at the end of each step and the values of the signals then; NaN: the tool does not run that component"""


@dataclass(frozen=True, kw_only=True)
class Job:
    """A run for a tool."""

    fmus: dict[str, Path]
    """FMUs by component, in the order of the loop"""
    ssp: Path
    """the same system as an SSP"""
    step: float
    """communication step of all [s]"""
    stop: float
    """Stop time [s]"""
    parameters: dict[str, dict[str, Parameter]]
    """Parameters by component, as in the SSP"""
    connections: tuple[tuple[End, End], ...]
    signals: tuple[str, ...]
    """see `assignment.Loop`"""
    recorded: Path
    """a run of this project's master, as .npy: time and signals at the end of initialisation, and at the start of each
    step"""
    folder: Path
    """Folder for files of the tool"""

    @property
    def steps(self) -> int:
        """Number of communication steps."""
        return round(self.stop / self.step)

    def to_json(self) -> str:
        """As JSON, for a process that need not have this package."""
        return json.dumps(asdict(self), default=str)

    @classmethod
    def from_json(cls, text: str) -> Job:
        """The job of a text from `to_json`."""
        document = json.loads(text)
        paths = {name: Path(document[name]) for name in ("ssp", "recorded", "folder")}
        connections = tuple((tuple(start), tuple(end)) for start, end in document["connections"])
        fmus = {name: Path(path) for name, path in document["fmus"].items()}
        return cls(
            **{**document, **paths, "fmus": fmus, "connections": connections, "signals": tuple(document["signals"])}
        )
