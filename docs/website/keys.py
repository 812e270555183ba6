"""The page of the keys of files: every table of every kind of file, as the program reads it."""

import dataclasses
import inspect
import types
import typing
from collections.abc import Iterator
from html import escape
from typing import Any, NamedTuple

import griffe
import pydantic

from docs.website.tables import table, words
from orchestration.comparison.file import ComparisonFile
from orchestration.quadrotor.initial_conditions import Starts
from orchestration.quadrotor.scenario_file import ScenarioFile
from orchestration.studies.study_file import StudyFile
from orchestration.system.system_file import SystemTable
from orchestration.tuning.tuning_file import TuningFile

FILES = {
    "System file": (SystemTable, "Any FMUs; [how to write one](systems.md)."),
    "Scenario file": (ScenarioFile, "A flight of the quadrotor; what it leaves out is the paper's flight."),
    "Study file": (StudyFile, "Many runs of a system or a scenario; [how to write one](studies.md)."),
    "Comparison file": (ComparisonFile, "Controllers against each other; [how to write one](compare.md)."),
    "Tuning file": (TuningFile, "What `quadcosim tune` searches; [how to write one](tuning.md)."),
}
OF_THE_BASE = {"Comparison file": {"[starts]": Starts}, "Tuning file": {"[starts]": Starts}}
"""Tables that are read by what a file builds on, here a scenario"""
INTRODUCTION = """\
# Keys of files

All files are TOML. A key that is not here is refused by name. Times are in seconds. A file's paths are relative to the
folder of the file. `quadcosim schema` prints the first of these tables as a JSON schema, from which editors complete
and check a system file.

"""
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
    said: str


def page() -> str:
    """The Markdown of the page."""
    return INTRODUCTION + "".join(_file(title, *about) for title, about in FILES.items())


def _file(title: str, shape: type, said: str) -> str:
    tables = {"": shape, **dict(_tables_in(shape, "")), **OF_THE_BASE.get(title, {})}
    sections = "".join(_section(place, each, title) for place, each in tables.items())
    return f"## {title}\n\n{said}\n\n{sections}"


def _section(place: str, shape: type, file: str) -> str:
    heading = f"### `{place}` of a {file.lower()}\n\n{_summary(shape)}\n\n" if place else ""
    rows = [(f"<code>{key.name}</code>", _kind(key.kind), key.default, words(key.said)) for key in _keys(shape)]
    return heading + table(rows, columns=("Key", "Value", "Without it", "Meaning"))


def _tables_in(shape: type, place: str) -> Iterator[tuple[str, type]]:
    """The tables within a table, by how they are headed in a file."""
    for key in _keys(shape):
        for within, many in _shapes(key.kind):
            path = f"{place}.{key.name}" if place else key.name
            headed = f"[[{path}]]" if many is list else f"[{path}.NAME]" if many is dict else f"[{path}]"
            yield headed, within
            yield from _tables_in(within, headed.strip("[]"))


def _shapes(kind: Any) -> Iterator[tuple[type, Any]]:
    """The tables that a value may be, each with what holds several of them."""
    if isinstance(kind, type) and (dataclasses.is_dataclass(kind) or _is_model(kind)):
        yield kind, None
    holder = {list: list, tuple: list, dict: dict}.get(typing.get_origin(kind))
    for part in typing.get_args(kind):
        yield from ((shape, holder or many) for shape, many in _shapes(part))


def _keys(shape: type) -> list[_Key]:
    """The keys of a table in their order, with what is said of them."""
    if _is_model(shape):
        fields = shape.model_fields  # type: ignore[attr-defined]
        return [
            _Key(
                field.alias or name,
                field.annotation,
                _default(field.get_default(), field.is_required()),
                field.description,
            )
            for name, field in fields.items()
        ]
    kinds, said = typing.get_type_hints(shape), _said(shape)
    return [_Key(f.name, kinds[f.name], _default_of(f), said.get(f.name, "")) for f in dataclasses.fields(shape)]


def _default_of(field: "dataclasses.Field[Any]") -> str:
    if field.default_factory is not dataclasses.MISSING:
        return _default(field.default_factory(), required=False)
    return _default(field.default, required=field.default is dataclasses.MISSING)


def _said(shape: type) -> dict[str, str]:
    """What the source says below the fields of a class, those of its bases among them."""
    said: dict[str, str] = {}
    for each in reversed(shape.__mro__[:-1]):
        found = griffe.visit(each.__module__, filepath=None, code=inspect.getsource(inspect.getmodule(each)))  # type: ignore[arg-type]
        members = found[each.__name__].attributes.items() if each.__name__ in found.members else ()
        said |= {name: member.docstring.value for name, member in members if member.docstring}
    return said


def _summary(shape: type) -> str:
    text = (shape.__doc__ or "").split("\n\n")[0]
    said = text.split(": ", 1)[1] if text.startswith("`[") and ": " in text else text
    return said[:1].upper() + said[1:]


def _default(value: Any, required: bool) -> str:
    if required:
        return "must be there"
    if (
        value is None
        or value in ({}, [], ())
        or dataclasses.is_dataclass(value)
        or isinstance(value, pydantic.BaseModel)
    ):
        return ""
    if isinstance(value, (list, tuple)):
        return "" if any(map(dataclasses.is_dataclass, value)) else f"<code>{escape(str(list(value)))}</code>"
    return f"<code>{escape(str(value).lower() if isinstance(value, bool) else str(value))}</code>"


def _kind(kind: Any) -> str:
    """What values a key has, in words."""
    origin, parts = typing.get_origin(kind), typing.get_args(kind)
    if origin is typing.Literal:
        return " or ".join(f"<code>{part}</code>" for part in parts)
    if {float, int, bool, str} <= set(parts):
        return "number, <code>true</code>, <code>false</code> or text"
    if origin in (types.UnionType, typing.Union):
        return " or ".join(dict.fromkeys(_kind(part) for part in parts if part is not types.NoneType))
    if origin in (list, tuple):
        kind = _kind(parts[0])
        return f"list of {PLURALS.get(kind, kind)}"
    if origin is dict or kind is dict:
        return "table"
    return KINDS.get(kind, "table" if any(_shapes(kind)) else "text")


def _is_model(shape: type) -> bool:
    return isinstance(shape, type) and issubclass(shape, pydantic.BaseModel)
