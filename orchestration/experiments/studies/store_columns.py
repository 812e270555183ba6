"""The tables and columns of a study's store."""

from collections.abc import Iterable

from orchestration.foundation.basics.errors import UsageError
from orchestration.simulation.results.objectives import FIXED
from orchestration.simulation.workers.row import TEXT

TEXTS = (TEXT,)
"""Metrics that are texts; all others are numbers"""
MAX_OBJECTIVES = 1000
"""Largest number of columns, a limit of SQLite"""

RUN = ("key", "status", "message", "seed", "duration", "machine", "engine")
"""Columns of a run besides its metrics"""
SETTINGS = "settings"
"""Column with the value of each axis, as JSON"""
DESIGN_WIDTH = 4
"""Number of columns of the design table"""
_RESERVED = ("design_index", *RUN, "checksum", SETTINGS)
_ORIGINS = ("guid.", "version.")
OBJECTIVES = "objectives"
"""Name of the entry of `about` that lists the objectives, written when the store is created"""
UNITS = "units"
"""Name of the entry of `about` with the units of metrics"""
GUIDS = "guids"
"""Name of the entry of `about` with the GUIDs of FMUs"""
ABOUT = "CREATE TABLE about (name TEXT PRIMARY KEY, value TEXT NOT NULL, checksum TEXT NOT NULL)"


def tables_for(objectives: Iterable[str]) -> dict[str, str]:
    """The SQL statements that create the tables, by table.

    Runs are identified by what determines them, so that rows remain valid when the design changes.
    """
    typed = ", ".join(f"{_quoted(name)} {'TEXT' if name in TEXTS else 'REAL'}" for name in metrics_with(objectives))
    return {
        "about": ABOUT,
        "design": "CREATE TABLE design (design_index INTEGER PRIMARY KEY, key TEXT NOT NULL, settings TEXT NOT NULL, "
        "checksum TEXT NOT NULL)",
        "runs": "CREATE TABLE runs (key TEXT PRIMARY KEY, status TEXT NOT NULL, message TEXT, seed INTEGER NOT NULL, "
        f"duration REAL, machine TEXT, engine TEXT, {typed}, checksum TEXT NOT NULL)",
    }


def _quoted(name: str) -> str:
    doubled = name.replace('"', '""')
    return f'"{doubled}"'


def metrics_with(objectives: Iterable[str]) -> tuple[str, ...]:
    """The metrics of a row, in their order."""
    return (*FIXED[:3], *objectives, *FIXED[3:])


def is_column(name: str, objectives: Iterable[str]) -> bool:
    """Whether the table of runs has a column of this name besides those of the axes."""
    return name in (*_RESERVED, *metrics_with(objectives)) or name.startswith(_ORIGINS)


def expect_columns(objectives: Iterable[str]) -> None:
    """Raise `UsageError` for objectives that are invalid as columns; SQLite ignores case."""
    taken = [*_RESERVED, *FIXED]
    for name in objectives:
        lower = name.lower()
        if not name or "\0" in name or lower in map(str.lower, taken) or lower.startswith(_ORIGINS):
            raise UsageError(f"objectives.{name}: the table of runs has a column of that name, expected another")
        taken.append(name)
    if len(taken) > MAX_OBJECTIVES:
        raise UsageError(f"objectives: {len(taken)} columns, expected at most {MAX_OBJECTIVES}")
