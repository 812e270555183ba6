"""The outcome of a run, and its directory."""

import json
import os
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from orchestration.errors import UsageError
from orchestration.master import Event
from orchestration.metrics import Metrics
from orchestration.scenario import Scenario, load_scenario
from orchestration.simulator import Floats

SIGNALS, EVENTS, METRICS, SCENARIO, PROVENANCE = (
    "signals.parquet",
    "events.parquet",
    "metrics.json",
    "scenario.toml",
    "provenance.json",
)


@dataclass(frozen=True, kw_only=True)
class Result:
    """One run: what was asked, what was recorded, what it comes to."""

    scenario: Scenario
    columns: tuple[str, ...]
    """`time`, then `plant.NAME` and `controller.NAME`"""
    rows: Floats
    """shape (n, number of columns); a row is the value just after its instant"""
    desired: Floats
    """P_d at the rows [m], inertial, shape (n, 3)"""
    events: tuple[Event, ...]
    """in order of time"""
    metrics: Metrics
    divergence: str | None
    """what diverged, if it did"""
    provenance: dict[str, Any]
    """versions, and the GUID of each FMU"""
    warnings: tuple[str, ...] = ()
    """what the FMUs warned of"""

    @cached_property
    def signals(self) -> dict[str, Floats]:
        """Every recorded column as an array of shape (n,)."""
        return {name: self.rows[:, i] for i, name in enumerate(self.columns)}

    @cached_property
    def sampled(self) -> npt.NDArray[np.bool_]:
        """Which rows are sampling instants, shape (n,)."""
        return sampled_rows(self.rows[:, 0], self.events)

    def save(self, folder: str | Path, *, figures: bool = True) -> Path:
        """Write the run's directory in one go, replacing an earlier run there; returns it.

        Raises `UsageError` if `folder` holds something else.
        """
        from orchestration import plots, tables

        with replaced_folder(Path(folder)) as partial:
            (partial / METRICS).write_text(json.dumps(self.metrics, indent=2) + "\n", encoding="utf-8")
            (partial / SCENARIO).write_text(self.scenario.to_toml(), encoding="utf-8")
            (partial / PROVENANCE).write_text(json.dumps(self._provenance(), indent=2) + "\n", encoding="utf-8")
            tables.write_signals(partial / SIGNALS, self.columns, self.rows, self.desired)
            tables.write_events(partial / EVENTS, self.events)
            if figures:
                plots.draw(self, partial)
        return Path(folder)

    def _provenance(self) -> dict[str, Any]:
        return {**self.provenance, "divergence": self.divergence, "warnings": list(self.warnings)}


def load_result(folder: str | Path) -> Result:
    """Read a run's directory; raises `UsageError` if it is none."""
    from orchestration import tables

    folder = Path(folder)
    missing = [name for name in (SIGNALS, EVENTS, METRICS, SCENARIO, PROVENANCE) if not (folder / name).is_file()]
    if missing:
        raise UsageError(f"{folder}: expected the directory of a run; it has no {', '.join(missing)}")
    columns, rows, desired = tables.read_signals(folder / SIGNALS)
    provenance = json.loads((folder / PROVENANCE).read_text(encoding="utf-8"))
    return Result(
        scenario=load_scenario(folder / SCENARIO),
        columns=columns,
        rows=rows,
        desired=desired,
        events=tables.read_events(folder / EVENTS),
        metrics=json.loads((folder / METRICS).read_text(encoding="utf-8")),
        divergence=provenance.pop("divergence"),
        warnings=tuple(provenance.pop("warnings")),
        provenance=provenance,
    )


def sampled_rows(time: Floats, events: tuple[Event, ...]) -> npt.NDArray[np.bool_]:
    """Which of the recorded times [s] are sampling instants."""
    samples = [event.time for event in events if event.kind == "sampled"]
    return np.isin(np.round(time * 1e9).astype(np.int64), np.array(samples, dtype=np.int64))


@contextmanager
def replaced_folder(folder: Path) -> Iterator[Path]:
    """A new folder beside `folder` that takes its place when all went well, and vanishes if not."""
    if folder.exists() and not (folder.is_dir() and (_is_run(folder) or not any(folder.iterdir()))):
        raise UsageError(f"{folder}: expected a new or empty directory, or that of an earlier run")
    folder.parent.mkdir(parents=True, exist_ok=True)
    partial = Path(tempfile.mkdtemp(prefix=f".{folder.name}.", suffix=".partial", dir=folder.parent))
    try:
        yield partial
        partial.chmod(0o755)
        if folder.exists():
            old = Path(tempfile.mkdtemp(prefix=f".{folder.name}.", suffix=".old", dir=folder.parent))
            os.replace(folder, old)
            os.replace(partial, folder)
            shutil.rmtree(old)
        else:
            os.replace(partial, folder)
    except BaseException:
        shutil.rmtree(partial, ignore_errors=True)
        raise


def _is_run(folder: Path) -> bool:
    return (folder / SCENARIO).is_file()
