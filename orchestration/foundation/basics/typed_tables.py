"""Tables of files, typed like the records that they describe; the first wrong key or type is a one-line error."""

import contextlib
import copy
import dataclasses
import functools
import inspect
import json
import types
import typing
from collections.abc import Callable, Collection, Mapping, Sequence, Set
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar, TypeVar

from orchestration.foundation.basics.attribute_docs import attribute_docs
from orchestration.foundation.basics.errors import UsageError, no_such_key, shown, without_unit
from orchestration.foundation.basics.fitting import MisfitError, fitted, hints_of
from orchestration.foundation.basics.records import default_of, is_record

if TYPE_CHECKING:
    import pydantic

Made = TypeVar("Made")
Shape = TypeVar("Shape")


@dataclass(frozen=True, kw_only=True)
class Key:
    """A key of a table of a file."""

    annotation: Any
    default: Any = dataclasses.MISSING
    alias: str | None = None
    """the key, where it differs from the field's name"""

    @property
    def is_required(self) -> bool:
        """Whether a file must have it."""
        return self.default is dataclasses.MISSING


class Table:
    """A table of a file; its attributes are the values of its keys, given or by default."""

    declared_by: ClassVar[type]
    given: Set[str]
    """Names of the fields that the file has"""

    def __init__(self, **values: Any) -> None:
        defaults = {name: copy.copy(key.default) for name, key in _keys_of(type(self)).items()}
        vars(self).update(defaults | values, given=frozenset(values))

    def as_dict(self, *, without: Collection[str] = ()) -> dict[str, Any]:
        """The values by the names of the fields."""
        return {name: getattr(self, name) for name in _keys_of(type(self)) if name not in without}

    @classmethod
    def of_table(cls, table: Mapping[str, Any]) -> "Table":
        """The table of a document; raises `MisfitError`."""
        keys = _keys_of(cls)
        names = {key.alias or name: name for name, key in keys.items()}
        if not table.keys() <= names.keys():
            raise MisfitError
        given = {names[key]: fitted(value, keys[names[key]].annotation, from_file=True) for key, value in table.items()}
        if any(key.is_required and name not in given for name, key in keys.items()):
            raise MisfitError
        return cls(**given)

    @classmethod
    def __get_pydantic_core_schema__(cls, _source: Any, handler: Any) -> Any:
        from pydantic_core import core_schema

        def table(model: "pydantic.BaseModel") -> Table:
            return cls(**{name: getattr(model, name) for name in model.model_fields_set})

        return core_schema.no_info_after_validator_function(
            table, handler.generate_schema(_model(cls)),
            serialization=core_schema.plain_serializer_function_ser_schema(lambda table: table.as_dict()),
        )  # fmt: skip


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

    def declared() -> dict[str, Key]:
        tables = {each.declared_by: each for each in within}
        keys: dict[str, Key] = {}
        for field in dataclasses.fields(record):
            if field.name in only if only else field.name not in without:
                hint, default = other.get(
                    field.name, (_in_file(hints_of(record)[field.name], tables), default_of(field))
                )
                default = tables[type(default)]() if type(default) in tables else default
                keys[field.name] = Key(annotation=hint, default=default, alias=(called or {}).get(field.name))
        return keys

    about = {"__doc__": record.__doc__, "declared_by": record, "_declared": staticmethod(declared)}
    return type(f"{record.__name__}Table", (Table,), about)


def _once(function: Callable[[Any], Made]) -> Callable[[Any], Made]:
    """The same, computed once for each class."""
    return functools.cache(function)


@_once
def _keys_of(table: Any) -> Mapping[str, Key]:
    """The keys of a table by the names of its fields: those of a record, and those that its class declares."""
    keys: dict[str, Key] = {}
    for cls in reversed(table.__mro__[: table.__mro__.index(Table)]):
        if "_declared" in vars(cls):
            keys |= vars(cls)["_declared"]()
        for name in inspect.get_annotations(cls):
            keys[name] = Key(annotation=hints_of(cls)[name], default=vars(cls).get(name, dataclasses.MISSING))
    return keys


@_once
def _model(table: Any) -> Any:
    """The model by which Pydantic words what is wrong with a table, and makes its JSON schema."""
    import pydantic

    def add_descriptions(schema: dict[str, Any]) -> None:
        for key, text in docs_of_keys(table).items():
            schema["properties"][key]["description"] = text

    fields: dict[str, Any] = {
        name: (key.annotation, pydantic.Field(... if key.is_required else key.default, alias=key.alias))
        for name, key in _keys_of(table).items()
    }
    config = pydantic.ConfigDict(
        extra="forbid", strict=True, protected_namespaces=(), json_schema_extra=add_descriptions
    )
    return pydantic.create_model(table.__name__, __config__=config, __doc__=table.__doc__, **fields)


def schema_of(table: type[Table]) -> dict[str, Any]:
    """The JSON schema of a table."""
    schema: dict[str, Any] = _model(table).model_json_schema(by_alias=True)
    return schema


def _in_file(hint: Any, tables: Mapping[Any, Any]) -> Any:
    """A type with its records replaced by their tables."""
    origin, parts = typing.get_origin(hint), typing.get_args(hint)
    if hint in tables:
        return tables[hint]
    if origin in (None, typing.Literal, typing.Annotated):
        return hint
    within = tuple(_in_file(part, tables) for part in parts)
    return typing.Union[within] if origin in (typing.Union, types.UnionType) else origin[within]  # noqa: UP007


def fields_of(shape: Any) -> dict[str, Key]:
    """The keys of a table or a record, as in its file; empty for another type."""
    return {key.alias or name: key for name, key in _fields(shape).items()}


def _fields(shape: Any) -> Mapping[str, Key]:
    kind: Any = shape if isinstance(shape, type) else type(shape)
    if issubclass(kind, Table):
        return _keys_of(kind)
    fields = dataclasses.fields(kind) if is_record(kind) else ()
    return {field.name: Key(annotation=hints_of(kind)[field.name], default=default_of(field)) for field in fields}


def docs_of_keys(shape: Any) -> dict[str, str]:
    """The docstring of each key of a table or a record."""
    classes = (*reversed(getattr(shape, "declared_by", shape).__mro__), shape)
    texts = {name: each.text for one in classes for name, each in attribute_docs(one.__module__, one.__name__).items()}
    return {field.alias or name: texts[name] for name, field in _fields(shape).items() if name in texts}


def keys_at(shape: Any, place: Sequence[Any]) -> list[str]:
    """The keys of the table at a place of a document of this shape."""
    shape = _shape_at(shape, place)
    return [*fields_of(shape), *getattr(getattr(shape, "declared_by", shape), "SHORTHANDS", ())]


def _shape_at(shape: Any, place: Sequence[Any]) -> Any:
    parts = iter(place)
    for part in parts:
        shape, one_of_many = _table_in(fields_of(shape)[part].annotation)
        if one_of_many:
            next(parts, None)  # none of a missing one
    return shape


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
    with contextlib.suppress(MisfitError, UsageError, ValueError, AssertionError, RecursionError):
        found: Shape = fitted(dict(tables), shape, from_file=True)
        return found
    import pydantic  # what is wrong is known to Pydantic

    try:
        return pydantic.TypeAdapter(shape).validate_json(json.dumps(tables, default=str))
    except pydantic.ValidationError as error:
        raise UsageError(_first_problem(error, shape, tables)) from error
    except RecursionError:
        raise UsageError("nested too deeply; expected the tables of a file of this kind") from None


_MISSING = ("missing", "missing_argument", "missing_keyword_only_argument")
_UNKNOWN = ("unexpected_keyword_argument", "extra_forbidden")
"""Pydantic's names of the error of an unknown key"""


def _most_relevant(error: "pydantic.ValidationError") -> Any:
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


_KIND = "Input should be a valid "


def _first_problem(error: "pydantic.ValidationError", file: type, document: Mapping[str, Any]) -> str:
    """The first error of a document of the shape `file`, in one line that states what is valid."""
    problem = _most_relevant(error)
    parts = _place(problem, document)
    place = ".".join(map(str, parts))
    if problem["type"] in _UNKNOWN:
        key = str(parts[-1])
        shape = _shape_at(file, parts[:-1])
        elsewhere = getattr(getattr(shape, "declared_by", shape), "ELSEWHERE", {})
        if key in elsewhere:
            return f"{place}: no such key; {elsewhere[key]}"
        return no_such_key(place.removesuffix(key), key, keys_at(file, parts[:-1]))
    if problem["type"] in _MISSING:
        keys = ", ".join(keys_at(file, parts))
        return f"{place}: expected {f'a table with {keys}' if keys else 'a value'}"
    value = problem["input"]
    message = problem["msg"]
    if message.startswith(_KIND):  # it may be one of several
        here = (each["msg"] for each in error.errors() if _place(each, document) == parts)
        kinds = list(dict.fromkeys(text.removeprefix(_KIND) for text in here if text.startswith(_KIND)))
        message = _KIND + " or ".join([", ".join(kinds[:-1]), kinds[-1]] if kinds[1:] else kinds)
    message = message.replace("Input should be", "expected")
    message = without_unit(f"{message[:1].lower()}{message[1:]}", value)
    return f"{place} = {shown(value if isinstance(value, float) else repr(value))}: {message}"
