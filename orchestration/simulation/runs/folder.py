"""Writes a folder of results beside its place and renames it when complete: a killed process leaves no partial one."""

import os
import re
import secrets
import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from orchestration.foundation.basics import scratch
from orchestration.foundation.basics.errors import QuadcosimError, UsageError
from orchestration.foundation.basics.scratch import Scratch

_HIDDEN = re.compile(r"\.(?P<name>.+)\.(?P<mark>[0-9a-f]{12})\.(?P<kind>new|old)", re.DOTALL)
"""`new`: being written; `old`: being replaced by the new one with the same mark, which is complete."""


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

    Remains of ended processes in the parent are cleaned up. Raises `UsageError` at once if `place` holds something
    that is not `replaceable`, stating what was `expected`, or if nothing can be written there; `QuadcosimError`
    stating where a precious one is kept.
    """
    _expect_place(place, replaceable, expected)
    mark = secrets.token_hex(6)
    try:
        place.parent.mkdir(parents=True, exist_ok=True)
        _clear(place.parent)
        partial = Scratch(place.parent / f".{place.name}.{mark}.new")
    except OSError as error:
        raise UsageError(f"{place}: expected a directory that can be written: {error}") from error
    new = NewFolder(path=partial.path, place=place)
    try:
        yield new
        if new.replaces or _is_free(place):
            _expect_place(place, replaceable, expected)
            _exchange(partial.path, place, place.parent / f".{place.name}.{mark}.old")
        else:
            new.place = _beside(partial.path, place)
    except BaseException as error:
        if new.precious and isinstance(error, Exception):
            raise QuadcosimError(f"{error}; what was written is in {_beside(partial.path, place)}") from error
        raise
    finally:
        partial.remove()  # does nothing after success


def _expect_place(place: Path, replaceable: Callable[[Path], bool], expected: str) -> None:
    if place.exists():
        if place.resolve() == Path.cwd():
            raise UsageError(f"{place}: expected another directory than the one you are in")
        if not (_is_free(place) or (place.is_dir() and replaceable(place))):
            raise UsageError(f"{place}: expected {expected}")


def _is_free(place: Path) -> bool:
    return not place.exists() or (place.is_dir() and not any(place.iterdir()))


def _exchange(new: Path, place: Path, old: Path) -> None:
    """Move `new` to its place; what was there moves to `old` and is removed."""
    if not place.exists():
        new.rename(place)
        return
    place.rename(old)
    try:
        new.rename(place)
    except OSError:
        old.rename(place)
        raise
    shutil.rmtree(old, ignore_errors=True)


def _beside(new: Path, place: Path) -> Path:
    """Move `new` to the first free name beside its place; returns that."""
    number = 1
    while (beside := place.with_name(f"{place.name}.{number}")).exists():
        number += 1
    new.rename(beside)
    return beside


def _clear(parent: Path) -> None:
    """Finish what ended processes have begun: move complete folders to their place, remove the rest."""
    hidden = {path: match for path in parent.glob(".*") if (match := _HIDDEN.fullmatch(path.name))}
    for path in scratch.abandoned(path for path, match in hidden.items() if match["kind"] == "new"):
        place, old = parent / hidden[path]["name"], path.with_suffix(".old")
        if old.exists() and not place.exists():
            os.replace(path, place)
        else:
            shutil.rmtree(path, ignore_errors=True)
    for path, match in hidden.items():
        if match["kind"] == "old" and not path.with_suffix(".new").exists() and (parent / match["name"]).exists():
            shutil.rmtree(path, ignore_errors=True)
