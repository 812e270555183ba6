"""Tables of a document as a dataclass of their shape: the first key or type that is wrong is said in one line."""

import dataclasses
import json
import typing
from collections.abc import Mapping
from typing import Any, TypeVar

import pydantic

from orchestration.basics.errors import UsageError, no_such_key, shown

Shape = TypeVar("Shape")


def parsed(tables: Mapping[str, Any], shape: type[Shape]) -> Shape:
    """The typed form of a TOML document; raises `UsageError` in one line for the first thing wrong."""
    try:
        return pydantic.TypeAdapter(shape).validate_json(json.dumps(tables, default=str), strict=True)
    except pydantic.ValidationError as error:
        raise UsageError(_first_problem(error, shape)) from error


_MISSING = ("missing", "missing_argument", "missing_keyword_only_argument")
_UNREAD = ("unexpected_keyword_argument", "extra_forbidden")


def telling(error: pydantic.ValidationError) -> Any:
    """The first thing wrong with a document; where a key is missing, one beside it that nobody reads: it was meant."""
    problems = error.errors()
    first = problems[0]
    if first["type"] not in _MISSING:
        return first
    beside = [each for each in problems if each["type"] in _UNREAD and each["loc"][:-1] == first["loc"][:-1]]
    return next(iter(beside), first)


def _first_problem(error: pydantic.ValidationError, file: type) -> str:
    """The first thing wrong with a document of the shape `file`, in one line that says what is valid."""
    problem = telling(error)
    place = ".".join(str(part) for part in problem["loc"])
    if problem["type"] == "unexpected_keyword_argument":
        table: Any = file
        for part in problem["loc"][:-1]:
            if isinstance(part, str):
                hint = next(f.type for f in dataclasses.fields(table) if f.name == part)
                table = typing.get_args(hint)[0] if typing.get_origin(hint) is list else hint
        names = [*(f.name for f in dataclasses.fields(table)), *getattr(table, "SHORTHANDS", ())]
        key = str(problem["loc"][-1])
        return no_such_key(place.removesuffix(key), key, names)
    if problem["type"] in _MISSING:
        return f"{place}: expected a value"
    value = problem["input"]
    message = problem["msg"].replace("Input should be", "expected")
    return f"{place} = {shown(value if isinstance(value, float) else repr(value))}: {message[:1].lower()}{message[1:]}"
