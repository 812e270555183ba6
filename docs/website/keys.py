"""The tables on the page of keys: those of every kind of file that the program reads."""

import types
import typing
from collections.abc import Iterator, Mapping, Sequence
from html import escape
from typing import Any, NamedTuple

from docs.website.tables import inline_html, table
from orchestration.experiments.comparison.file import ComparisonFile
from orchestration.experiments.studies.study_file import StudyFile
from orchestration.experiments.tuning.tuning_file import TuningFile
from orchestration.foundation.basics.records import Scalar
from orchestration.foundation.basics.typed_tables import docs_of_keys, fields_of
from orchestration.quadrotor.scenarios.file import ScenarioFile
from orchestration.systems.system.file import SystemTable

FILES = {
    "System file": (SystemTable, "Any FMUs; [how to write one](systems.md)."),
    "Scenario file": (ScenarioFile, "A flight of the quadrotor; what it leaves out is the paper's flight."),
    "Study file": (StudyFile, "Many runs of a system or a scenario; [how to write one](studies.md)."),
    "Comparison file": (ComparisonFile, "Controllers against each other; [how to write one](compare.md)."),
    "Tuning file": (TuningFile, "What `quadcosim tune` searches; [how to write one](compare.md#tuning)."),
}
KINDS = {
    float: "number",
    int: "whole number",
    bool: "<code>true</code> or <code>false</code>",
    str: "text",
    Any: "anything",
}
PLURALS = {"number": "numbers", "whole number": "whole numbers", "text": "texts", "table": "tables"}


class _Key(NamedTuple):
    name: str
    kind: Any
    default: str
    description: str


def section() -> str:
    """The Markdown that follows the text of `docs/keys.md` on the site."""
    return "\n" + "".join(_file(title, *about) for title, about in FILES.items())


def _file(title: str, shape: Any, description: str) -> str:
    tables = {"": shape, **dict(_tables_in(shape, ""))}
    places: dict[Any, list[str]] = {}
    for place, each in tables.items():
        places.setdefault(each, []).append(place)
    sections = "".join(_section(of, each, title) for each, of in places.items())
    return f"## {title}\n\n{description}\n\n{sections}"


def _section(places: Sequence[str], shape: Any, file: str) -> str:
    """The section of a table that occurs in one or several places of a file."""
    named = ", ".join(f"`{place}`" for place in places)
    heading = f"### {named} of a {file.lower()}\n\n{_summary(shape)}\n\n" if named != "``" else ""
    rows = [
        (f"<code>{key.name}</code>", _kind(key.kind), key.default, inline_html(key.description)) for key in _keys(shape)
    ]
    return heading + table(rows, columns=("Key", "Value", "Without it", "Meaning"))


def _tables_in(shape: Any, place: str) -> Iterator[tuple[str, Any]]:
    """The tables within a table, by their headings in a file."""
    for key in _keys(shape):
        for within, many in _shapes(key.kind):
            path = f"{place}.{key.name}" if place else key.name
            headed = f"[[{path}]]" if many is list else f"[{path}.NAME]" if many is dict else f"[{path}]"
            yield headed, within
            yield from _tables_in(within, headed.strip("[]"))


def _shapes(kind: Any) -> Iterator[tuple[Any, Any]]:
    """The types of tables that a value may have, each with its container."""
    if fields_of(kind):
        yield kind, None
    holder = {list: list, tuple: list, dict: dict, Mapping: dict}.get(typing.get_origin(kind))
    for part in typing.get_args(kind):
        yield from ((shape, holder or many) for shape, many in _shapes(part))


def _keys(shape: Any) -> list[_Key]:
    """The keys of a table in order, with their descriptions."""
    descriptions = docs_of_keys(shape)
    return [
        _Key(key, field.annotation, _default(field), descriptions.get(key, ""))
        for key, field in fields_of(shape).items()
    ]


def _summary(shape: Any) -> str:
    text = (shape.__doc__ or "").split("\n\n")[0]
    summary = text.split(": ", 1)[1] if text.startswith("`[") and ": " in text else text
    return summary[:1].upper() + summary[1:]


def _default(field: Any) -> str:
    if field.is_required:
        return "must be there"
    value = field.default
    if value is None or value in ({}, [], ()) or fields_of(value):
        return ""
    if isinstance(value, (list, tuple)):
        return "" if any(map(fields_of, value)) else f"<code>{escape(str(list(value)))}</code>"
    return f"<code>{escape(str(value).lower() if isinstance(value, bool) else str(value))}</code>"


def _kind(kind: Any) -> str:
    """The description of a key's values."""
    origin, parts = typing.get_origin(kind), typing.get_args(kind)
    if origin is typing.Literal:
        return " or ".join(f"<code>{part}</code>" for part in parts)
    if kind == Scalar:
        return "number, <code>true</code>, <code>false</code> or text"
    if origin in (types.UnionType, typing.Union):
        return " or ".join(dict.fromkeys(_kind(part) for part in parts if part is not types.NoneType))
    if origin in (list, tuple):
        kind = _kind(parts[0])
        return f"list of {PLURALS.get(kind, kind)}"
    if origin in (dict, Mapping):
        return "table"
    return KINDS.get(kind, "table" if any(_shapes(kind)) else "text")
