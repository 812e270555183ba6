"""Reads text, TOML and JSON files that people write, raising `UsageError` for whatever is wrong; makes JSON values.

A file is read up to a stated size, so that none fills memory, and may begin with a byte-order mark.
"""

import json
import logging
import re
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path, PurePath
from typing import Any

from orchestration.foundation.basics.errors import WHOLE_NUMBER, UsageError, shown, without_unit

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

_NOTES = logging.getLogger("quadcosim")

MAX_FILE_LENGTH = 2**20
"""Largest number of characters in a TOML or JSON file"""
MAX_NAME_LENGTH = 200
DEEPEST = 20
"""Largest nesting depth of tables and lists"""

_PART = r"""(?:[\w-]+|"(?:[^"\\\n]|\\.)*"?|'[^'\n]*'?)"""
_NEXT = rf"(?:[ \t]*\.[ \t]*{_PART})"
_KEYS = re.compile(rf"#[^\n]*|(?P<deep>{_PART}{_NEXT}{{{DEEPEST}}})|{_PART}{_NEXT}*")
"""Keys, and what looks like keys; linear in the length of the text."""


@contextmanager
def readable(path: Path, what: str) -> Iterator[None]:
    """Turn a failure to open or decode a file into a `UsageError` that states what was expected."""
    try:
        yield
    except OSError as error:
        reason = error.strerror or str(error)
        raise UsageError(f"{path}: expected a readable {what}: {reason[:1].lower()}{reason[1:]}") from error
    except UnicodeDecodeError as error:
        raise UsageError(f"{path}: expected a readable {what}: its text is not in UTF-8 ({error.reason})") from error


def read_text(path: Path, what: str, largest: int = MAX_FILE_LENGTH) -> str:
    """The text of a UTF-8 file of at most `largest` characters; raises `UsageError`, naming `what` it should be."""
    if "\0" in str(path):
        raise UsageError(f"{path}: expected a path without NUL characters")
    _NOTES.debug("reading %s %s", what, path)
    with readable(path, what), path.open(encoding="utf-8-sig") as file:
        text = file.read(largest + 1)
    if len(text) > largest:
        raise UsageError(f"{path}: expected a readable {what}: it has more than {largest} characters")
    return text


def read_toml(path: Path, what: str) -> dict[str, Any]:
    """The tables of a TOML file.

    Raises `UsageError` as `toml_of`, and for a file that cannot be read.
    """
    return toml_of(read_text(path, what), str(path))


def toml_of(text: str, path: str) -> dict[str, Any]:
    """The tables of user-written TOML; errors name `path`.

    Raises `UsageError` for text that is not TOML, is nested deeper than `DEEPEST`, or contains a whole number beyond
    64 bits or a NUL character.
    """
    if any(key["deep"] for key in _KEYS.finditer(text)):  # parsing time is quadratic in the parts of a key
        raise UsageError(f"{path}: expected TOML nested at most {DEEPEST} deep")
    try:
        tables: dict[str, Any] = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise UsageError(f"{path}: expected TOML: {error}{_of_unit_at(text, str(error))}") from error
    except ValueError as error:  # a number with more digits than Python converts
        raise UsageError(f"{path}: expected whole numbers of at most 64 bits") from error
    except RecursionError as error:
        raise UsageError(f"{path}: expected TOML nested at most {DEEPEST} deep") from error
    _expect_plain(tables, path)
    return tables


_WITH_UNIT = re.compile(r"[+-]?[\d._]+(?:[eE][+-]?\d+)?\s*(?P<unit>[^\W\d]\w*)(?=\s*(?:[,\]}#]|$))")


def _of_unit_at(text: str, problem: str) -> str:
    """The end of a message on text that is not TOML: that a number has a unit, if it has one at that place."""
    place = re.search(r"line (\d+), column (\d+)", problem)
    if place is None:
        return ""
    line, column = text.split("\n")[int(place[1]) - 1].rstrip(), int(place[2]) - 1
    there = (found[0] for found in _WITH_UNIT.finditer(line) if found.start("unit") == column)
    return "".join(f"; {value}: expected {without_unit('a number', value)}" for value in there)


def copied_tables(tables: Mapping[str, Any]) -> dict[str, Any]:
    """A copy of tables that were made by code, in the types of a document: lists for tuples and arrays of NumPy."""
    return {key: _copied(value) for key, value in tables.items()}


def _copied(value: Any) -> Any:
    if isinstance(value, Mapping):
        return copied_tables(value)
    if isinstance(value, (list, tuple, range)):
        return [_copied(each) for each in value]
    if isinstance(value, PurePath):
        return str(value)
    return value.tolist() if hasattr(value, "tolist") else value


def tables_in(text: str) -> dict[str, Any]:
    """The tables of TOML that this project has written, without checks."""
    tables: dict[str, Any] = tomllib.loads(text)
    return tables


def read_json(path: Path, largest: int = MAX_FILE_LENGTH) -> Any:
    """The value of a JSON file of at most `largest` characters.

    Raises `UsageError` if it is not JSON, which has no `NaN` and `Infinity`.
    """
    text = read_text(path, "JSON file", largest)
    try:
        value = json.loads(text, parse_constant=_refuse_constant)
    except (ValueError, RecursionError) as error:
        raise UsageError(f"{path}: expected JSON, as it was written: {error}") from error
    _expect_plain(value, str(path))
    return value


def plain(value: object) -> Any:
    """`value` in the types of JSON: dataclasses as objects, paths as text, numbers that are not finite as None.

    NumPy scalars become Python scalars.
    """
    from pydantic_core import to_jsonable_python  # deferred: `--help` does not need it

    return to_jsonable_python(value, inf_nan_mode="null", fallback=_other)


def _other(value: object) -> Any:
    if isinstance(value, Mapping):
        return dict(value)
    if isinstance(value, PurePath):
        return str(value)
    if getattr(value, "shape", None) == ():  # a NumPy scalar
        return value.item()  # type: ignore[attr-defined]
    raise TypeError(f"{type(value).__name__}: no type that JSON has")


def _refuse_constant(name: str) -> None:
    raise ValueError(f"{name} is no JSON")


def _expect_plain(value: Any, place: str) -> None:
    """Raise `UsageError`, naming the place, for values that later readers cannot take."""
    waiting = [(place, 0, value)]
    while waiting:
        place, depth, value = waiting.pop()
        if isinstance(value, str) and "\0" in value:
            raise UsageError(f"{place} = {shown(repr(value))}: expected text without NUL characters")
        if isinstance(value, int) and not -(2**63) <= value < 2**63:
            raise UsageError(f"{place}: expected {WHOLE_NUMBER}")
        if isinstance(value, Mapping):
            items = [(str(key), item) for key, item in value.items()]
        elif isinstance(value, Sequence) and not isinstance(value, str):
            items = [(str(index), item) for index, item in enumerate(value)]
        else:
            continue
        if depth == DEEPEST:
            raise UsageError(f"{place}: expected at most {DEEPEST} tables and lists in each other")
        for key, item in items:
            if "\0" in key or len(key) > MAX_NAME_LENGTH:
                expected = f"a name without NUL characters, of at most {MAX_NAME_LENGTH} characters"
                raise UsageError(f"{place}: {shown(repr(key))}: expected {expected}")
            waiting.append((f"{place}: {key}" if depth == 0 else f"{place}.{key}", depth + 1, item))
