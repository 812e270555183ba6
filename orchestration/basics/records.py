"""Records: frozen dataclasses, declared once for file and constructor, which refuse the same in one line."""

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

from orchestration.basics.errors import UsageError, no_such_key, shown

if TYPE_CHECKING:
    import pydantic
    from pydantic_core import CoreSchema

Class = TypeVar("Class", bound=type)
Made = TypeVar("Made")


class _Scalar:
    """Not all that has a value as a float is one: whole numbers of NumPy's stay whole. What is most often is first."""

    @staticmethod
    def __get_pydantic_core_schema__(_source: Any, _handler: Any) -> "CoreSchema":
        from pydantic_core import core_schema

        truth, real, text = core_schema.bool_schema(), core_schema.float_schema(), core_schema.str_schema()
        whole = core_schema.int_schema(ge=-(2**63), lt=2**63)
        only_float = core_schema.chain_schema([core_schema.is_instance_schema(float), real])
        return core_schema.json_or_python_schema(
            core_schema.union_schema([truth, whole, real, text], mode="left_to_right"),
            core_schema.union_schema([only_float, truth, whole, text], mode="left_to_right"),
        )


Scalar = Annotated[bool | int | float | str, _Scalar]
"""What a parameter of an FMU can be, and a value of an axis"""

_CONFIG: "pydantic.ConfigDict" = {"extra": "forbid", "strict": True, "arbitrary_types_allowed": True}


@dataclass_transform(kw_only_default=True, frozen_default=True, field_specifiers=(dataclasses.field,))
def record(place: str = "") -> Callable[[Class], Class]:
    """A frozen dataclass whose constructor raises `UsageError`, in one line, for names and types that no file has.

    Fields that are missing, that there are not, or of another type are named after their `place`. A list is taken for
    a tuple, text for a path and a path for text, and a number of NumPy's for one of Python's. Its `repr` says what is
    not as by default.

    Who makes none of them loads no pydantic: processes that fly get theirs made.
    """

    def declared(cls: Class) -> Class:
        made: Any = dataclasses.dataclass(frozen=True, kw_only=True, repr=False)(cls)
        made.__pydantic_config__ = _CONFIG
        if "__repr__" not in vars(cls):
            made.__repr__ = _short

        @functools.wraps(made.__init__)
        def checked(self: Any, *unnamed: Any, **given: Any) -> None:
            import pydantic

            try:
                _fill(self, cls, unnamed, given)
            except pydantic.ValidationError:
                _expect_names(cls, place, unnamed, given)
                try:
                    meant = {name: _meant(value, _holds_path(cls, name)) for name, value in given.items()}
                    _fill(self, cls, (), meant)
                except pydantic.ValidationError as error:
                    _complain_by_meaning(cls, given)
                    raise UsageError(_first_problem(error, place, given)) from None

        made.__init__ = checked
        found: Class = made
        return found

    return declared


@functools.cache
def validated(record: type) -> Any:
    """A record as pydantic has it: its validator, and its fields as those of any table."""
    import pydantic.dataclasses

    return pydantic.dataclasses.dataclass(frozen=True, kw_only=True, repr=False)(record)


def is_record(kind: Any) -> bool:
    """Whether it is a class of records."""
    return isinstance(kind, type) and "__pydantic_config__" in vars(kind) and dataclasses.is_dataclass(kind)


def _fill(record: Any, cls: type, unnamed: Sequence[Any], given: Mapping[str, Any]) -> None:
    """Give a record its values; raises `pydantic.ValidationError` for what they may not be."""
    from pydantic_core import ArgsKwargs

    validated(cls).__pydantic_validator__.validate_python(ArgsKwargs(tuple(unnamed), dict(given)), self_instance=record)


def like(record: Made, **values: Any) -> Made:
    """A record with other values that are as right as its own: nothing is checked again, which takes a run of a study
    half a millisecond.
    """
    made = object.__new__(type(record))
    vars(made).update({field.name: getattr(record, field.name) for field in dataclasses.fields(record)} | values)  # type: ignore[arg-type]
    return made


def called(words: str) -> Callable[[Class], Class]:
    """What an error says is expected where a value of a class, mostly a protocol, is not given."""

    def decorated(cls: Class) -> Class:
        _WORDS[cls.__name__] = words
        return cls

    return decorated


_WORDS = {"Path": "a path"}


def _short(self: Any) -> str:
    """The class with the fields that differ from their defaults, long ones cut."""
    given = {field.name: getattr(self, field.name) for field in dataclasses.fields(self)}
    defaults = {field.name: default_of(field) for field in dataclasses.fields(self)}
    said = [f"{name}={_SHORTENED.repr(value)}" for name, value in given.items() if value != defaults[name]]
    return f"{type(self).__name__}({', '.join(said)})"


_SHORTENED = reprlib.Repr()
_SHORTENED.maxtuple, _SHORTENED.maxdict, _SHORTENED.maxstring, _SHORTENED.maxother = 6, 6, 80, 400


def default_of(field: "dataclasses.Field[Any]") -> Any:
    """What a field is that nobody gives; `dataclasses.MISSING` where it must be given."""
    return field.default_factory() if field.default_factory is not dataclasses.MISSING else field.default


def _expect_names(cls: type, place: str, unnamed: Sequence[Any], given: Mapping[str, Any]) -> None:
    fields = dataclasses.fields(cls)
    names = [field.name for field in fields]
    if unnamed:
        raise _unlike(cls.__name__, unnamed[0], f"values by name, as in {names[0]}=…") from None
    for name in given:
        if name not in names:
            raise UsageError(no_such_key(place, name, names)) from None
    for field in fields:
        if field.name not in given and default_of(field) is dataclasses.MISSING:
            raise UsageError(f"{place}{field.name}: expected a value") from None


def _holds_path(cls: Any, name: str) -> bool:
    hint = validated(cls).__pydantic_fields__[name].annotation
    return hint is Path or Path in typing.get_args(hint)


def _meant(value: Any, as_path: bool) -> Any:
    """A value in the types of files: those of NumPy, lists and other mappings are no other values."""
    if as_path:
        return Path(value) if isinstance(value, str) else value
    if getattr(value, "shape", None) == () and hasattr(value, "item"):
        return value.item()
    if isinstance(value, os.PathLike):
        return os.fspath(value)
    if isinstance(value, Mapping):
        return {key: _meant(each, as_path) for key, each in value.items()}
    if isinstance(value, Collection) and not isinstance(value, (str, bytes, Set)):
        return tuple([_meant(each, as_path) for each in value])
    return value


def _complain_by_meaning(cls: Any, given: Mapping[str, Any]) -> None:
    """What the record itself says, if anything: it may say better what it expects, a probability, not just a number."""
    attempt = object.__new__(cls)
    vars(attempt).update({field.name: default_of(field) for field in dataclasses.fields(cls)} | dict(given))
    with contextlib.suppress(TypeError, AttributeError):
        attempt.__post_init__()


def _first_problem(error: "pydantic.ValidationError", place: str, given: Mapping[str, Any]) -> str:
    """The first thing wrong with what was given, in one line that says where it is and what is expected there."""
    problems = error.errors()
    first = problems[0]
    parts, value = _place(first["loc"], given)
    if first["loc"][-1] == "[key]":
        return str(_unlike(place + ".".join(parts[:-1]), parts[-1], "names that are text"))
    at = place + ".".join(map(str, parts))
    alike = {each["type"] for each in problems if _place(each["loc"], given)[0] == parts}
    if alike & {"less_than", "greater_than_equal"}:
        return f"{at}: expected a whole number of at most 64 bits"
    if first["type"] == "literal_error":
        words = re.findall(r"'([^']*)'", first["ctx"]["expected"])
        return f"{at} = {shown(value)}: expected one of {', '.join(words)}"
    is_scalar = {"bool_type", "string_type"} <= alike
    return str(_unlike(at, value, "a number, true, false or a text" if is_scalar else _expected(first)))


def _place(loc: Sequence[Any], given: Any) -> tuple[list[Any], Any]:
    """Where a problem is, without the parts that say by which type a value was read, and the value there."""
    parts, value = [], given
    for part in loc:
        with contextlib.suppress(LookupError, TypeError):
            value = value[part]
            parts.append(part)
    return parts, value


def _expected(problem: Any) -> str:
    context = problem.get("ctx", {})
    name = context.get("class_name") or context.get("class")
    if name is not None:
        return _WORDS.get(str(name), f"a value made by {name}(…)")
    if problem["type"] in ("missing", "too_long", "too_short"):
        return "another number of values"
    message = str(problem["msg"]).removeprefix("Input should be ")
    return {"a valid tuple": "a valid array", "a valid dictionary": "an object"}.get(message, message)


def _unlike(place: str, value: Any, expected: str) -> UsageError:
    return UsageError(f"{place} = {shown(value if isinstance(value, float) else repr(value))}: expected {expected}")
