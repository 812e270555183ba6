"""The directory of a run. It appears when complete: a killed run leaves none that looks complete."""

import hashlib
import json
from collections.abc import Callable, Container, Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, cast

from fmu_kit.new_files import NewFiles, WriteError, clear, write_atomically
from orchestration.foundation.basics.documents import read_json
from orchestration.foundation.basics.errors import Named, QuadcosimError, SimulatorError, UsageError, one_line, shown
from orchestration.foundation.recording import tables
from orchestration.foundation.recording.tables import ToFolder
from orchestration.simulation.engines.resolved import columns_of
from orchestration.simulation.figures.names import FORMATS
from orchestration.simulation.figures.views import files, view_of
from orchestration.simulation.requests.request import load_request
from orchestration.simulation.results.units import ColumnInfo
from orchestration.simulation.runs.outcome import RunInterrupted
from orchestration.simulation.runs.result import Provenance, Result
from orchestration.systems.system.request import system_of


@dataclass(kw_only=True)
class NewFolder:
    """A folder that is written at `path` and moved to `place` when complete."""

    path: Path
    place: Path
    precious: bool = False
    """Whether it is kept beside its place if it cannot be completed or moved there"""
    replaces: bool = True
    """Whether it takes the place of an existing folder, instead of being kept beside it"""


@contextmanager
def new_folder(place: Path, replaceable: Callable[[Path], bool], expected: str) -> Iterator[NewFolder]:
    """A folder that is moved to its `place` on success and removed on failure, unless it is `precious`.

    Raises `UsageError` at once if `place` holds something that is not `replaceable`, stating what was `expected`, or if
    nothing can be written there; `WriteError`; `QuadcosimError` stating where a precious one is kept.
    """
    clear(place.parent)
    _expect_place(place, replaceable, expected)
    try:
        files = NewFiles(place.parent)
    except WriteError as error:
        raise UsageError(f"{place}: expected a directory that can be written: {error.strerror}") from error
    new = NewFolder(path=files.path / place.name, place=place)
    try:
        new.path.mkdir()
        yield new
        if new.replaces or _is_free(place):
            _expect_place(place, replaceable, expected)
            files.publish(replaces_folders=True)
        else:
            new.place = _beside(new.path, place)
    except BaseException as error:
        told = files.error_of(error) if isinstance(error, OSError) else None
        if new.precious and isinstance(error, Exception):
            raise QuadcosimError(f"{told or error}; what was written is in {_beside(new.path, place)}") from error
        if told is not None:
            raise told from error
        raise
    finally:
        files.remove()  # does nothing after success


def _expect_place(place: Path, replaceable: Callable[[Path], bool], expected: str) -> None:
    if place.exists():
        if place.resolve() == Path.cwd():
            raise UsageError(f"{place}: expected another directory than the one you are in")
        if not (_is_free(place) or (place.is_dir() and replaceable(place))):
            raise UsageError(f"{place}: expected {expected}")


def _is_free(place: Path) -> bool:
    return not place.exists() or (place.is_dir() and not any(place.iterdir()))


def _beside(new: Path, place: Path) -> Path:
    """Move `new` to the first free name beside its place; returns that."""
    number = 1
    while (beside := place.with_name(f"{place.name}.{number}")).exists():
        number += 1
    new.rename(beside)
    return beside


SIGNALS, EVENTS = tables.SIGNALS, tables.EVENTS
METRICS, SCENARIO, PROVENANCE = "metrics.json", "scenario.toml", "provenance.json"
CHECKSUMS = "checksums"
"""Key in the provenance of the checksums of all files of a run"""
_CHECKED = (SIGNALS, EVENTS, METRICS, SCENARIO)
MAX_JSON_LENGTH = 2**26
"""Largest number of characters of its JSON files: the provenance describes each column"""
MAT = "run.mat"
"""File of a run that has been exported to it"""
STATE = "paused.npz"
"""File of a run that has been paused"""


def save_run(result: Result, out: str | Path, *, figures: bool = True) -> Path:
    """Write the directory of a run, replacing an earlier run there; returns it.

    Raises `UsageError` if `out` holds something else, and for what is no result.
    """
    if not isinstance(result, Result):
        raise UsageError(f"save_run: {shown(repr(result))}: expected a Result of run: others keep no run to be written")
    with run_folder(Path(out), (METRICS,)) as new:
        tables.copy(result.recording, new.path, result.about)
        _write(result, new.path, figures=figures)
    return Path(out)


def _write(result: Result, folder: Path, *, figures: bool) -> None:
    """Write all files of the directory of a run but its recording."""
    notes = {
        **result.provenance,
        "units": dict(result.units),
        "described": {name: asdict(one) for name, one in result.described.items()},
        "parameters": dict(result.parameters),
        "divergence": result.divergence,
        "termination": result.termination,
        "interrupted_at": result.interrupted_at,
        "warnings": list(result.warnings),
    }
    write_atomically(folder / METRICS, json.dumps(result.metrics, indent=2) + "\n")
    write_atomically(folder / SCENARIO, result.request.to_toml())
    notes[CHECKSUMS] = _checksums(folder, notes)
    write_atomically(folder / PROVENANCE, json.dumps(notes, indent=2) + "\n")
    if figures:
        from orchestration.simulation.figures import style
        from orchestration.simulation.runs import (
            draw,
        )  # not before: loads matplotlib, which takes longer than a short run

        style.save(draw.draw(result, view_of(result.request.kind, result.recording.columns).first), folder)


def load_run(folder: str | Path) -> Result:
    """Read the directory of a run; raises `UsageError` if it is none, or if a file in it has changed."""
    folder = Path(folder)
    missing = [name for name in (*_CHECKED, PROVENANCE) if not (folder / name).is_file()]
    if missing:
        raise UsageError(f"{folder}: expected the directory of a run; it has no {', '.join(missing)}")
    notes = _object(
        folder / PROVENANCE, divergence=_TEXT, termination=_TEXT, units=(dict,), described=(dict,), parameters=(dict,),
        interrupted_at=_NUMBER, warnings=(list,), checksums=(dict,),
    )  # fmt: skip
    checksums = notes.pop(CHECKSUMS)
    recording = tables.InFolder(folder)
    request = load_request(folder / SCENARIO)
    system = system_of(request)
    missing = [name for name in columns_of(system) if name not in recording.columns]
    if missing:
        raise UsageError(f"{folder / SIGNALS}: no column {', '.join(missing)}; expected those of a run")
    if not len(recording):
        raise UsageError(f"{folder}: expected the directory of a run; it has no rows")
    for _ in recording.chunks():  # damage is found now
        pass
    metrics = _object(folder / METRICS, diverged=(bool,), divergence_time=_NUMBER)
    for name, checksum in _checksums(folder, notes).items():  # a file may be intact and of another run
        if checksums.get(name) != checksum:
            raise UsageError(f"{folder / name}: has been changed since the run; expected it as it was written")
    return Result(
        request=request,
        system=system,
        recording=recording,
        metrics=Named(metrics),
        units=notes.pop("units"),
        described={name: ColumnInfo(**one) for name, one in notes.pop("described").items()},
        parameters=notes.pop("parameters"),
        divergence=notes.pop("divergence"),
        termination=notes.pop("termination"),
        interrupted_at=notes.pop("interrupted_at"),
        warnings=tuple(notes.pop("warnings")),
        provenance=cast(Provenance, notes),
    )


def _checksums(folder: Path, notes: Mapping[str, object]) -> dict[str, str]:
    """The checksums of all files of a run, by name; that of the provenance covers the other notes in it."""
    checksums = {name: _checksum(folder / name) for name in _CHECKED}
    return {**checksums, PROVENANCE: hashlib.sha256(json.dumps(notes).encode()).hexdigest()}


def _checksum(path: Path) -> str:
    """SHA-256 of a file, which may be larger than the memory."""
    digest = hashlib.sha256()
    with path.open("rb") as file:
        while block := file.read(1 << 20):
            digest.update(block)
    return digest.hexdigest()


_TEXT, _NUMBER = (str, type(None)), (int, float, type(None))


def _object(path: Path, **types: tuple[type, ...]) -> dict[str, Any]:
    """The object in a JSON file; raises `UsageError` unless the values by these names have one of these types."""
    content = read_json(path, MAX_JSON_LENGTH)
    if not isinstance(content, dict):
        raise UsageError(f"{path}: expected an object")
    for name, kinds in types.items():
        if name not in content or not isinstance(content[name], kinds):
            raise UsageError(f"{path}: {name}: expected what was written, got {shown(content.get(name))}")
    return content


def keep_run(
    folder: str | Path,
    simulate: Callable[[ToFolder], Result | None],
    *,
    figures: bool = True,
    replaces: Container[str] = (METRICS,),
) -> Result | None:
    """Run, and write the directory of the run, whose place is checked before; returns the result.

    `simulate` receives a recorder that writes into the new directory; if it returns None, it has written there what is
    to be kept. The directory replaces an earlier one that has a file of `replaces`. If it cannot, it is kept beside
    `folder`, and `QuadcosimError` states where. After Ctrl-C, or if an FMU or its process has failed, what was recorded
    is kept too, but replaces nothing: `RunInterrupted` or `SimulatorError` states where. Raises `UsageError` if
    `folder` holds something else or cannot be written.
    """
    ended: RunInterrupted | SimulatorError | None = None
    with run_folder(Path(folder), replaces) as new:
        try:
            result = simulate(ToFolder(new.path))
        except (RunInterrupted, SimulatorError) as stop:
            if stop.result is None:
                raise
            ended, result = stop, stop.result
            new.replaces = result.interrupted_at is None
        new.precious = True
        if result is not None:
            _write(result, new.path, figures=figures)
    if ended is not None and result is not None:
        ended.result = replace(result, recording=tables.InFolder(new.place))
        ended.args = (f"{ended}; what was recorded is in {one_line(str(new.place))}",)
        raise ended
    return result and replace(result, recording=tables.InFolder(new.place))


def run_folder(folder: Path, replaces: Container[str] = ()) -> AbstractContextManager[NewFolder]:
    """A new folder of a run, which replaces `folder` if that has a file of `replaces` and no unknown file."""
    kinds = {METRICS: "an earlier run", STATE: "a paused run"}
    allowed = [text for name, text in kinds.items() if name in replaces]
    expected = ", or that of ".join(["a new or empty directory", *allowed]) + " with nothing else in it" * bool(allowed)

    def replaceable(place: Path) -> bool:
        names = {path.name for path in place.iterdir() if path.is_file()}
        others = {path.name for path in place.iterdir()} - _KNOWN - files()
        return (not others or others <= _figures_of_signals(place)) and any(
            name in names and name in replaces for name in kinds
        )

    return new_folder(folder, replaceable, expected)


def _figures_of_signals(place: Path) -> set[str]:
    """The names of files that a figure of a signal, or of the signals below a name, may have there."""
    described = read_json(place / PROVENANCE, MAX_JSON_LENGTH)["described"] if (place / PROVENANCE).is_file() else ()
    parts = (column.split(".") for column in described)
    return {f"{'.'.join(part[:k])}.{ending}" for part in parts for k in range(1, len(part) + 1) for ending in FORMATS}


_KNOWN = {
    SIGNALS,
    EVENTS,
    METRICS,
    SCENARIO,
    PROVENANCE,
    STATE,
    MAT,
    "signals.csv",
    "events.csv",
}
