"""Writes a folder of results beside its place and renames it when complete: a killed process leaves no partial one."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from fmu_kit.new_files import NewFiles, WriteError, clear
from orchestration.foundation.basics.errors import QuadcosimError, UsageError


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
