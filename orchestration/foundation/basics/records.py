"""Records: frozen dataclasses, declared once for file and constructor, with the same one-line errors in both."""

import contextlib
import dataclasses
import functools
import os
import re
import reprlib
import typing
from collections.abc import Callable, Collection, Mapping, Sequence, Set
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TypeVar

from typing_extensions import dataclass_transform

from orchestration.foundation.basics.errors import WHOLE_NUMBER, UsageError, no_such_key, shown
from orchestration.foundation.basics.fitting import Before, MarkedFloat, MisfitError, fitted, hints_of
from orchestration.foundation.processes.passable import passable

if TYPE_CHECKING:
    import pydantic
    from pydantic_core import CoreSchema

Class = TypeVar("Class", bound=type)
Record = TypeVar("Record")


class _Scalar(Before):
    """The schema of a scalar: NumPy's integers stay integers, and the most frequent type is tried first."""

    def __get_pydantic_core_schema__(self, _source: Any, _handler: Any) -> "CoreSchema":
        from pydantic_core import core_schema

        truth, real, text = core_schema.bool_schema(), core_schema.float_schema(), core_schema.str_schema()
        whole = core_schema.int_schema(ge=-(2**63), lt=2**63)
        marked = core_schema.is_instance_schema(MarkedFloat)
        only_float = core_schema.chain_schema([core_schema.is_instance_schema(float), real])
        return core_schema.json_or_python_schema(
            core_schema.union_schema([truth, whole, real, text], mode="left_to_right"),
            core_schema.union_schema([marked, only_float, truth, whole, text], mode="left_to_right"),
        )


Scalar = Annotated[bool | int | float | str, _Scalar(lambda value: value, keeps_marks=True)]
"""The value of an FMU's parameter or of an axis"""

_CONFIG: "pydantic.ConfigDict" = {"extra": "forbid", "strict": True, "arbitrary_types_allowed": True}


@dataclass_transform(kw_only_default=True, frozen_default=True, field_specifiers=(dataclasses.field,))
def record(place: str = "") -> Callable[[Class], Class]:
    """A frozen dataclass whose constructor raises `UsageError`, in one line, for names and types invalid in a file.

    Missing, unknown and mistyped fields are named after their `place`. A list is accepted for a tuple, text for a path
    and a path for text, and a NumPy number for one of Python's. Its `repr` shows the fields that differ from their
    defaults. It may be a key of a dictionary, where its own dictionaries are not changed.

    Pydantic is loaded by the first value that does not fit as it is.
    """

    def declared(cls: Class) -> Class:
        record_class: Any = dataclasses.dataclass(frozen=True, kw_only=True, repr=False)(cls)
        record_class.__pydantic_config__ = _CONFIG
        if "__repr__" not in vars(cls):
            record_class.__repr__ = _short_repr
        record_class.__hash__ = _hash_by(record_class.__hash__)

        @functools.wraps(record_class.__init__)
        def checked(self: Any, *args: Any, **kwargs: Any) -> None:
            if not args and _fits(self, cls, kwargs):
                return
            import pydantic

            try:
                _fill(self, cls, args, kwargs)
            except pydantic.ValidationError:
                _expect_names(cls, place, args, kwargs)
                try:
                    coerced = {name: _coerced(value, _holds_path(cls, name)) for name, value in kwargs.items()}
                    _fill(self, cls, (), coerced)
                except pydantic.ValidationError as error:
                    _raise_own_error(cls, kwargs)
                    raise UsageError(_first_problem(error, place, kwargs)) from None

        record_class.__init__ = checked
        record_class.of_table = classmethod(_of_table)
        result: Class = passable(record_class)
        return result

    return declared


@functools.cache
def validated(record: type) -> Any:
    """A record as a pydantic dataclass, with its validator and its fields."""
    import pydantic.dataclasses

    return pydantic.dataclasses.dataclass(frozen=True, kw_only=True, repr=False)(record)


def is_record(kind: Any) -> bool:
    """Whether it is a class made by `record`."""
    return isinstance(kind, type) and "__pydantic_config__" in vars(kind) and dataclasses.is_dataclass(kind)


def _fits(record: Any, cls: type, values: Mapping[str, Any], *, from_file: bool = False) -> bool:
    """Set the fields of a record to values that fit as they are; false if one does not, or is missing or unknown."""
    try:
        vars(record).update(_fitted_fields(cls, values, from_file))
        if hasattr(cls, "__post_init__"):
            record.__post_init__()
    except (MisfitError, ValueError, AssertionError):
        return False
    return True


def _fitted_fields(cls: Any, values: Mapping[str, Any], from_file: bool) -> dict[str, Any]:
    fields, hints = {field.name: default_of(field) for field in dataclasses.fields(cls)}, hints_of(cls)
    fields |= {name: fitted(value, hints.get(name), from_file=from_file) for name, value in values.items()}
    if len(fields) > len(dataclasses.fields(cls)) or any(value is dataclasses.MISSING for value in fields.values()):
        raise MisfitError
    return fields


def _of_table(cls: type, table: Mapping[str, Any]) -> Any:
    """The record of a table of a file; raises `MisfitError`."""
    made: Any = object.__new__(cls)
    if not _fits(made, cls, table, from_file=True):
        raise MisfitError
    return made


def _fill(record: Any, cls: type, args: Sequence[Any], kwargs: Mapping[str, Any]) -> None:
    """Set the fields of a record; raises `pydantic.ValidationError` for invalid values."""
    from pydantic_core import ArgsKwargs

    validated(cls).__pydantic_validator__.validate_python(ArgsKwargs(tuple(args), dict(kwargs)), self_instance=record)


def replaced(record: Record, **values: Any) -> Record:
    """A copy of a record with other values, which must be valid: checks would cost each run of a study 0.5 ms."""
    copy = object.__new__(type(record))
    vars(copy).update({field.name: getattr(record, field.name) for field in dataclasses.fields(record)} | values)  # type: ignore[arg-type]
    return copy


def described_as(words: str) -> Callable[[Class], Class]:
    """Decorate a class, mostly a protocol, with its description in errors: `expected` these `words`."""

    def decorated(cls: Class) -> Class:
        _DESCRIPTIONS[cls.__name__] = words
        return cls

    return decorated


_DESCRIPTIONS = {"Path": "a path"}


def _short_repr(self: Any) -> str:
    """The class with the fields that differ from their defaults, long ones cut."""
    values = {field.name: getattr(self, field.name) for field in dataclasses.fields(self)}
    defaults = {field.name: default_of(field) for field in dataclasses.fields(self)}
    changed = [f"{name}={_SHORTENED.repr(value)}" for name, value in values.items() if value != defaults[name]]
    return f"{type(self).__name__}({', '.join(changed)})"


def _hash_by(usual: Callable[[Any], int]) -> Callable[[Any], int]:
    """The hash of a record: the usual one of dataclasses, or where it has dictionaries, whose order does not count."""

    def hash_of(self: Any) -> int:
        try:
            return usual(self)
        except TypeError:
            return hash(tuple(_hashable(getattr(self, field.name)) for field in dataclasses.fields(self)))

    return hash_of


def _hashable(value: Any) -> Any:
    """A value, or one that is as equal and has a hash."""
    if isinstance(value, Mapping):
        return frozenset((key, _hashable(each)) for key, each in value.items())
    return tuple(map(_hashable, value)) if isinstance(value, (list, tuple)) else value


_SHORTENED = reprlib.Repr()
_SHORTENED.maxtuple, _SHORTENED.maxdict, _SHORTENED.maxstring, _SHORTENED.maxother = 6, 6, 80, 400


def default_of(field: "dataclasses.Field[Any]") -> Any:
    """The default of a field; `dataclasses.MISSING` if it is required."""
    return field.default_factory() if field.default_factory is not dataclasses.MISSING else field.default


def _expect_names(cls: type, place: str, args: Sequence[Any], kwargs: Mapping[str, Any]) -> None:
    fields = dataclasses.fields(cls)
    names = [field.name for field in fields]
    if args:
        raise _unexpected(cls.__name__, args[0], f"values by name, as in {names[0]}=…") from None
    for name in kwargs:
        if name not in names:
            if name in (elsewhere := getattr(cls, "ELSEWHERE", {})):
                raise UsageError(f"{place}{name}: no such key; {elsewhere[name]}") from None
            in_files = ", ".join(getattr(cls, "SHORTHANDS", ()))
            raise UsageError(no_such_key(place, name, names, in_files and f", or in files {in_files}")) from None
    for field in fields:
        if field.name not in kwargs and default_of(field) is dataclasses.MISSING:
            raise UsageError(f"{place}{field.name}: expected a value") from None


def _holds_path(cls: Any, name: str) -> bool:
    hint = hints_of(cls)[name]
    return hint is Path or Path in typing.get_args(hint)


def _coerced(value: Any, as_path: bool) -> Any:
    """A value in the types of files: Python scalars for NumPy's, tuples for collections, dicts for mappings."""
    if as_path:
        return Path(value) if isinstance(value, str) else value
    if getattr(value, "shape", None) == () and hasattr(value, "item"):
        return value.item()
    if isinstance(value, os.PathLike):
        return os.fspath(value)
    if isinstance(value, Mapping):
        return {key: _coerced(each, as_path) for key, each in value.items()}
    if isinstance(value, Collection) and not isinstance(value, (str, bytes, Set)):
        return tuple([_coerced(each, as_path) for each in value])
    return value


def _raise_own_error(cls: Any, kwargs: Mapping[str, Any]) -> None:
    """Raise the record's own error, if any, or that of a table for one: it may be more exact than a type."""
    for name, hint in hints_of(cls).items():
        if is_record(hint) and type(kwargs.get(name)) is dict and all(type(key) is str for key in kwargs[name]):
            hint(**kwargs[name])
    attempt = object.__new__(cls)
    vars(attempt).update({field.name: default_of(field) for field in dataclasses.fields(cls)} | dict(kwargs))
    with contextlib.suppress(TypeError, AttributeError):
        attempt.__post_init__()


def _first_problem(error: "pydantic.ValidationError", place: str, kwargs: Mapping[str, Any]) -> str:
    """The first validation error in one line that states its place and what is expected there."""
    problems = error.errors()
    first = problems[0]
    parts, value = _place(first["loc"], kwargs)
    if first["loc"][-1] == "[key]":
        return str(_unexpected(place + ".".join(parts[:-1]), parts[-1], "names that are text"))
    at = place + ".".join(map(str, parts))
    alike = {each["type"] for each in problems if _place(each["loc"], kwargs)[0] == parts}
    if alike & {"less_than", "greater_than_equal"}:
        return f"{at}: expected {WHOLE_NUMBER}"
    if first["type"] == "literal_error":
        words = re.findall(r"'([^']*)'", first["ctx"]["expected"])
        return f"{at} = {shown(value)}: expected one of {', '.join(words)}"
    is_scalar = {"bool_type", "string_type"} <= alike
    return str(_unexpected(at, value, "a number, true, false or a text" if is_scalar else _expected(first)))


def _place(loc: Sequence[Any], kwargs: Any) -> tuple[list[Any], Any]:
    """The place of a validation error, without the parts that name the type tried, and the value there."""
    parts, value = [], kwargs
    for part in loc:
        with contextlib.suppress(LookupError, TypeError):
            value = value[part]
            parts.append(part)
    return parts, value


def _expected(problem: Any) -> str:
    context = problem.get("ctx", {})
    name = context.get("class_name") or context.get("class")
    if name is not None:
        return _DESCRIPTIONS.get(str(name), f"a value made by {name}(…)")
    if problem["type"] in ("missing", "too_long", "too_short"):
        return "another number of values"
    message = str(problem["msg"]).removeprefix("Input should be ")
    return {"a valid tuple": "a valid array", "a valid dictionary": "an object"}.get(message, message)


def _unexpected(place: str, value: Any, expected: str) -> UsageError:
    return UsageError(f"{place} = {shown(value if isinstance(value, float) else repr(value))}: expected {expected}")
