"""What is in a folder: files by their digests, stores by their rows."""

import hashlib
import re
import shutil
import sqlite3
import tempfile
from contextlib import closing
from pathlib import Path

HIDDEN = re.compile(r"(^|/)\.quadcosim-|\.new$|\.partial$")
"""What the next process removes"""
_WHOLE = re.compile(r"(|.*/)\.quadcosim-[0-9a-f]+\.new/whole/(.+)")
JOURNALS = ("-wal", "-shm", "-journal", ".lock")
"""Endings of files beside a store that are there or not"""
VARYING = ("duration", "machine", "checksum")
"""Columns of a store's rows that differ from run to run"""
STORE = ".sqlite"
EMPTY = "empty folder"
NOTHING = hashlib.sha256(b"").hexdigest()

Contents = dict[str, str]
"""The digests of the files below a folder, by path; of a folder without files, and of rows of stores, a word"""


def contents(folder: Path) -> Contents:
    """What is in a folder, without journals of stores."""
    found: Contents = {}
    for path in folder.rglob("*"):
        name = path.relative_to(folder).as_posix()
        if path.suffix == STORE:
            found |= {name: "store", **{f"{name}: {row}": "row" for row in rows(path)}}
        elif path.is_file() and not name.endswith(JOURNALS):
            found[name] = _digest(path)
        elif path.is_dir() and not any(path.iterdir()):
            found[name] = EMPTY
    return found


def as_bytes(folder: Path) -> Contents:
    """The bytes of all files, and all folders."""
    paths = {path.relative_to(folder).as_posix(): path for path in folder.rglob("*")}
    return {name: _digest(path) if path.is_file() else "folder" for name, path in paths.items()}


def without_varying(found: Contents, varying: set[str]) -> Contents:
    """The same, where of files that differ from run to run only the names count, and none is empty."""
    return {name: "any" if name in varying and digest != NOTHING else digest for name, digest in found.items()}


def finished(found: Contents) -> Contents:
    """The same with what the next process moves to its place, where one was killed."""
    moved = {match[1] + match[2]: digest for name, digest in found.items() if (match := _WHOLE.match(name))}
    return {**found, **moved}


def without_hidden(found: Contents) -> Contents:
    """The same without what the next process removes."""
    return {name: digest for name, digest in found.items() if not HIDDEN.search(name)}


def difference(one: Contents, other: Contents) -> str:
    """How they differ, in words."""
    names = sorted(name for name in {*one, *other} if one.get(name) != other.get(name))
    return f"{len(names)} files differ, as {names[0][:200]}" if names else "the same files"


def rows(store: Path, *, whole: bool = False) -> list[str]:
    """The rows of a store, with its journal; `whole` ones have the columns that vary, too."""
    with tempfile.TemporaryDirectory() as folder:  # reading may move the journal into the store
        for path in (store.with_name(f"{store.name}{ending}") for ending in ("", "-wal", "-journal")):
            if path.exists():
                shutil.copy(path, folder)
        with closing(sqlite3.connect(Path(folder) / store.name)) as connection:
            return [row for table in _tables(connection) for row in _rows(connection, table, whole)]


def _tables(connection: sqlite3.Connection) -> list[str]:
    return [name for (name,) in connection.execute("SELECT name FROM sqlite_master WHERE type = 'table'")]


def _rows(connection: sqlite3.Connection, table: str, whole: bool) -> list[str]:
    chosen = " WHERE name != 'agreement'" if table == "about" else ""  # it is of the runs that were made last
    found = connection.execute(f'SELECT * FROM "{table}"{chosen}')
    names = [column[0] for column in found.description]
    kept = [i for i, name in enumerate(names) if whole or name not in VARYING]
    return [f"{table} {[row[i] for i in kept]}" for row in found]


def _digest(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()
