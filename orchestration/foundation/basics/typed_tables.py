"""Tables of files, typed like the records that they describe; the first wrong key or type is a one-line error."""

import dataclasses
import json
import types
import typing
from collections.abc import Mapping, Sequence
from typing import Any, ClassVar, TypeVar

import pydantic

from orchestration.foundation.basics.attribute_docs import attribute_docs
from orchestration.foundation.basics.errors import UsageError, no_such_key, shown
from orchestration.foundation.basics.records import default_of, is_record, validated

Shape = TypeVar("Shape")


def _add_descriptions(schema: dict[str, Any], table: type["Table"]) -> None:
    """Describe each key in a JSON schema by the docstring of its field."""
    for key, text in docs_of_keys(table).items():
        schema["properties"][key]["description"] = text


class Table(pydantic.BaseModel):
    """A table of a file; unknown keys are refused."""

    model_config = pydantic.ConfigDict(
        extra="forbid",
        strict=True,
        frozen=True,
        protected_namespaces=(),
        json_schema_extra=_add_descriptions,
    )
    declared_by: ClassVar[type]


def table_of(
    record: type,
    *,
    only: Sequence[str] = (),
    without: Sequence[str] = (),
    called: Mapping[str, str] | None = None,
    within: Sequence[Any] = (),
    **other: tuple[Any, Any],
) -> Any:
    """The table of a file that describes a record, with the keys, types and defaults that the record declares.

    `only` are its fields, default: all but those `without`; `called` are keys that differ from the field's name,
    `within` the tables of the records in it, and `other` the types and defaults of keys whose form in a file differs
    from that in the constructor.
    """
    tables = {each.declared_by: each for each in within}
    hints = typing.get_type_hints(record, include_extras=True)
    fields: dict[str, Any] = {}
    for field in dataclasses.fields(record):
        if field.name in only if only else field.name not in without:
            hint, default = other.get(field.name, (_in_file(hints[field.name], tables), default_of(field)))
            default = tables[type(default)]() if type(default) in tables else default
            default = ... if default is dataclasses.MISSING else default
            fields[field.name] = (hint, pydantic.Field(default, alias=(called or {}).get(field.name)))
    table = pydantic.create_model(f"{record.__name__}Table", __base__=Table, __doc__=record.__doc__, **fields)
    table.declared_by = record
    return table


def _in_file(hint: Any, tables: Mapping[Any, Any]) -> Any:
    """A type with its records replaced by their tables."""
    origin, parts = typing.get_origin(hint), typing.get_args(hint)
    if hint in tables:
        return tables[hint]
    if origin in (None, typing.Literal, typing.Annotated):
        return hint
    within = tuple(_in_file(part, tables) for part in parts)
    return typing.Union[within] if origin in (typing.Union, types.UnionType) else origin[within]  # noqa: UP007


def fields_of(shape: Any) -> dict[str, Any]:
    """The pydantic fields of a table or a record by the keys of its file; empty for another type."""
    return {field.alias or name: field for name, field in _fields(shape).items()}


def _fields(shape: Any) -> dict[str, Any]:
    kind = shape if isinstance(shape, type) else type(shape)
    if is_record(kind):
        kind = validated(kind)
    fields: dict[str, Any] = getattr(kind, "__pydantic_fields__", {})
    return fields


def docs_of_keys(shape: Any) -> dict[str, str]:
    """The docstring of each key of a table or a record."""
    classes = (*reversed(getattr(shape, "declared_by", shape).__mro__), shape)
    texts = {name: each.text for one in classes for name, each in attribute_docs(one.__module__, one.__name__).items()}
    return {field.alias or name: texts[name] for name, field in _fields(shape).items() if name in texts}


def keys_at(shape: Any, place: Sequence[Any]) -> list[str]:
    """The keys of the table at a place of a document of this shape."""
    parts = iter(place)
    for part in parts:
        shape, one_of_many = _table_in(fields_of(shape)[part].annotation)
        if one_of_many:
            next(parts)
    return [*fields_of(shape), *getattr(getattr(shape, "declared_by", shape), "SHORTHANDS", ())]


def _table_in(hint: Any) -> tuple[Any, bool]:
    """The table that a value of this type is or contains, and whether it contains several."""
    if fields_of(hint):
        return hint, False
    origin = typing.get_origin(hint)
    tables = (_table_in(part) for part in typing.get_args(hint))
    shape, one_of_many = next((each for each in tables if each[0] is not None), (None, False))
    return shape, one_of_many or origin not in (typing.Union, types.UnionType)


def parsed(tables: Mapping[str, Any], shape: type[Shape]) -> Shape:
    """The typed form of a TOML document; raises `UsageError` in one line for the first error."""
    try:
        return pydantic.TypeAdapter(shape).validate_json(json.dumps(tables, default=str))
    except pydantic.ValidationError as error:
        raise UsageError(_first_problem(error, shape, tables)) from error
    except RecursionError:
        raise UsageError("nested too deeply; expected the tables of a file of this kind") from None


_MISSING = ("missing", "missing_argument", "missing_keyword_only_argument")
_UNKNOWN = ("unexpected_keyword_argument", "extra_forbidden")
"""Pydantic's names of the error of an unknown key"""


def _most_relevant(error: pydantic.ValidationError) -> Any:
    """The first error of a document; for a missing key, an unknown key beside it, which is likely a misspelling."""
    problems = error.errors()
    first = _of_a_table(problems)
    if first["type"] not in _MISSING:
        return first
    beside = [each for each in problems if each["type"] in _UNKNOWN and each["loc"][:-1] == first["loc"][:-1]]
    return next(iter(beside), first)


def _of_a_table(problems: Sequence[Any]) -> Any:
    """The first error; for a table where a number is also valid, the error within the table."""
    first = problems[0]
    if first["type"] != "float_type" or not isinstance(first["input"], Mapping):
        return first
    place = first["loc"][:-1]
    within = [each for each in problems if each["loc"][: len(place)] == place and len(each["loc"]) > len(place) + 1]
    return next(iter(within), first)


def _place(problem: Any, document: Any) -> list[Any]:
    """The place of an error, without the parts that name which of several types was tried."""
    parts, value = [], document
    for part in problem["loc"]:
        try:
            value = value[part]
        except (LookupError, TypeError):
            continue
        parts.append(part)
    return parts if problem["type"] not in _MISSING else [*parts, problem["loc"][-1]]


def _first_problem(error: pydantic.ValidationError, file: type, document: Mapping[str, Any]) -> str:
    """The first error of a document of the shape `file`, in one line that states what is valid."""
    problem = _most_relevant(error)
    parts = _place(problem, document)
    place = ".".join(map(str, parts))
    if problem["type"] in _UNKNOWN:
        key = str(parts[-1])
        return no_such_key(place.removesuffix(key), key, keys_at(file, parts[:-1]))
    if problem["type"] in _MISSING:
        return f"{place}: expected a value"
    value = problem["input"]
    message = problem["msg"].replace("Input should be", "expected")
    return f"{place} = {shown(value if isinstance(value, float) else repr(value))}: {message[:1].lower()}{message[1:]}"
