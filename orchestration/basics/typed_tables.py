"""Tables of a document as a dataclass of their shape: the first key or type that is wrong is said in one line."""

import dataclasses
import json
import typing
from collections.abc import Mapping
from typing import Any, TypeVar

import pydantic

from orchestration.basics.errors import UsageError, shown

Shape = TypeVar("Shape")


def parsed(tables: Mapping[str, Any], shape: type[Shape]) -> Shape:
    """The typed form of a TOML document; raises `UsageError` in one line for the first thing wrong."""
    try:
        return pydantic.TypeAdapter(shape).validate_json(json.dumps(tables, default=str), strict=True)
    except pydantic.ValidationError as error:
        raise UsageError(_first_problem(error, shape)) from error


def _first_problem(error: pydantic.ValidationError, file: type) -> str:
    """The first thing wrong with a document of the shape `file`, in one line that says what is valid."""
    problem = error.errors()[0]
    place = ".".join(str(part) for part in problem["loc"])
    if problem["type"] == "unexpected_keyword_argument":
        table: Any = file
        for part in problem["loc"][:-1]:
            if isinstance(part, str):
                hint = next(f.type for f in dataclasses.fields(table) if f.name == part)
                table = typing.get_args(hint)[0] if typing.get_origin(hint) is list else hint
        names = [*(f.name for f in dataclasses.fields(table)), *getattr(table, "SHORTHANDS", ())]
        keys = ", ".join(names)
        return f"{place}: no such key; expected one of {keys}"
    if problem["type"] in ("missing", "missing_argument", "missing_keyword_only_argument"):
        return f"{place}: expected a value"
    value = problem["input"]
    message = problem["msg"].replace("Input should be", "expected")
    return f"{place} = {shown(value if isinstance(value, float) else repr(value))}: {message[:1].lower()}{message[1:]}"
