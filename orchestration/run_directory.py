"""A run's directory: written in one go, so that a killed run leaves none that looks whole."""

import json
import os
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from orchestration import plots, tables
from orchestration.errors import UsageError
from orchestration.result import Result
from orchestration.scenario_file import load_scenario

SIGNALS, EVENTS = "signals.parquet", "events.parquet"
METRICS, SCENARIO, PROVENANCE = "metrics.json", "scenario.toml", "provenance.json"
STATE = "paused.npz"
"""of a run that has been paused"""


def save_run(result: Result, folder: str | Path, *, figures: bool = True) -> Path:
    """Write the directory of a run, replacing an earlier run there; returns it.

    Raises `UsageError` if `folder` holds something else.
    """
    notes = {**result.provenance, "divergence": result.divergence, "warnings": list(result.warnings)}
    with replaced_folder(Path(folder)) as partial:
        (partial / METRICS).write_text(json.dumps(result.metrics, indent=2) + "\n", encoding="utf-8")
        (partial / SCENARIO).write_text(result.scenario.to_toml(), encoding="utf-8")
        (partial / PROVENANCE).write_text(json.dumps(notes, indent=2) + "\n", encoding="utf-8")
        tables.write_signals(partial / SIGNALS, result.columns, result.rows, result.desired)
        tables.write_events(partial / EVENTS, result.events)
        if figures:
            plots.draw(result, partial)
    return Path(folder)


def load_run(folder: str | Path) -> Result:
    """Read the directory of a run; raises `UsageError` if it is none."""
    folder = Path(folder)
    missing = [name for name in (SIGNALS, EVENTS, METRICS, SCENARIO, PROVENANCE) if not (folder / name).is_file()]
    if missing:
        raise UsageError(f"{folder}: expected the directory of a run; it has no {', '.join(missing)}")
    columns, rows, desired = tables.read_signals(folder / SIGNALS)
    notes = json.loads((folder / PROVENANCE).read_text(encoding="utf-8"))
    return Result(
        scenario=load_scenario(folder / SCENARIO),
        columns=columns,
        rows=rows,
        desired=desired,
        events=tables.read_events(folder / EVENTS),
        metrics=json.loads((folder / METRICS).read_text(encoding="utf-8")),
        divergence=notes.pop("divergence"),
        warnings=tuple(notes.pop("warnings")),
        provenance=notes,
    )


@contextmanager
def replaced_folder(folder: Path) -> Iterator[Path]:
    """A new folder beside `folder` that takes its place when all went well, and vanishes if not."""
    if folder.exists() and not _is_replaceable(folder):
        raise UsageError(
            f"{folder}: expected a new or empty directory, or that of an earlier run with nothing else in it"
        )
    if folder.resolve() == Path.cwd():
        raise UsageError(f"{folder}: expected another directory than the one you are in")
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


def _is_replaceable(folder: Path) -> bool:
    known = {SIGNALS, EVENTS, METRICS, SCENARIO, PROVENANCE, STATE, *(f"{name}.png" for name in plots.FIGURES)}
    return folder.is_dir() and all(path.name in known and path.is_file() for path in folder.iterdir())
