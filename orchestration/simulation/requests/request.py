"""Reads requests to run: a system file or a scenario of the quadrotor, both TOML; an SSP with its timing; an FMU."""

import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TypeAlias

from orchestration.foundation.basics.documents import copied_tables, read_toml
from orchestration.foundation.basics.errors import UsageError, shown
from orchestration.foundation.basics.terminal import warn
from orchestration.simulation.requests.kinds import KINDS, RequestKind
from orchestration.systems.system.file import is_system, system_from_tables
from orchestration.systems.system.model import System
from orchestration.systems.system.request import Request

SSP_ENDINGS = (".ssp", ".ssd")
FMU = ".fmu"
"""Ending of the file of one FMU, which runs alone"""
WHAT = "system or scenario file"
SSP = "ssp"
"""Key of a file with timing: the SSP that it is for"""


RequestLike: TypeAlias = Request | str | os.PathLike[str] | Mapping[str, Any]
"""A request, the path of its file, or the content of the file as a dictionary"""


def request_of(request: RequestLike) -> Request:
    """The request in any of these forms; relative paths of a dictionary start at the current folder.

    Raises `UsageError` for anything else, and as `load_request`.
    """
    if isinstance(request, (str, os.PathLike)):
        return load_request(Path(request))
    if isinstance(request, Mapping):
        return request_from_tables(copied_tables(request), Path())
    if isinstance(request, type) or not isinstance(request, Request):
        expected = "a Scenario, a System, the path of a file of one, or its tables as a dictionary"
        raise UsageError(f"{shown(repr(request))}: expected {expected}")
    return request


def default_request() -> Request:
    """What runs if nothing is said: the paper's flight."""
    return _kind().default()


def load_request(path: str | Path, timing: str | Path | None = None) -> Request:
    """Read a system file, a scenario file, an FMU, or an SSP with a file of its `timing`.

    Paths are relative to their file. An FMU runs alone, through its default experiment.
    A file with timing may be given alone if it names its SSP; without one, an SSP has the timing of its annotation.
    Raises `UsageError` for a file that cannot be read, a key that does not exist (naming those that do) or a value of
    the wrong type.
    """
    path = Path(path)
    if path.suffix.lower() in SSP_ENDINGS:
        overlay = None if timing is None else read_toml(Path(timing), "file with timing")
        if (
            overlay is not None
            and SSP in overlay
            and (Path(timing or "").parent / str(overlay.pop(SSP))).resolve() != path.resolve()
        ):
            raise UsageError(f"{timing}: ssp: names another file than {path}")
        with _errors_naming(path if timing is None else Path(timing)):
            return _from_ssp(path, overlay, path.parent if timing is None else Path(timing).parent)
    if timing is not None:
        raise UsageError(f"{timing}: expected no second file; only an SSP has its timing in one")
    if path.suffix.lower() == FMU:
        from orchestration.simulation.requests.one_fmu import alone  # not before: loads what reads and proposes

        return alone(path)
    tables = read_toml(path, WHAT)
    if not tables:
        warn(f"{path}: is empty: it is the paper's flight, as without a file")
    with _errors_naming(path):
        if isinstance(tables.get(SSP), str):
            return _from_ssp(path.parent / tables.pop(SSP), tables, path.parent)
        return request_from_tables(tables, path.parent)


def request_from_tables(tables: dict[str, Any], folder: Path) -> Request:
    """The system or the scenario of a TOML document whose relative paths start at `folder`; raises `UsageError`."""
    return (system_from_tables if is_system(tables) else _kind().from_tables)(tables, folder)


def _kind() -> RequestKind:
    return next(KINDS.all())


def _from_ssp(path: Path, timing: dict[str, Any] | None, folder: Path) -> System:
    from orchestration.simulation.requests.ssp.reading import tables_of_ssp  # which loads XML, needed for no other file

    return system_from_tables(tables_of_ssp(path, timing), folder)


@contextmanager
def _errors_naming(path: Path) -> Iterator[None]:
    """Begin the message of each `UsageError` with the path."""
    try:
        yield
    except UsageError as error:
        if str(error).startswith(f"{path}: "):
            raise
        raise UsageError(f"{path}: {error}") from error
