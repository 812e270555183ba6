"""Values of a command line that need no conversion by the parser, which would load Pydantic for each command.

Only what the parser would accept, with the same result: values that are not given, texts, decimal numbers, and paths.
All else is left to it, with its messages.
"""

import os
import re
import typing
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import typer.core

_WHOLE = re.compile(r"[+-]?[0-9]{1,18}")
_DECIMAL = re.compile(r"[+-]?([0-9]{1,18}\.?|[0-9]{0,18}\.[0-9]{1,18})([eE][+-]?[0-9]{1,3})?")
_LEFT = object()


class TakesPlainValues:
    """A command of the parser, or a group of commands, that takes such values of its parameters as they are."""

    def get_params(self, ctx: Any) -> list[Any]:
        """The parameters, as the parser asks for them."""
        parameters: list[Any] = super().get_params(ctx)  # type: ignore[misc]
        for parameter in parameters:
            if hasattr(parameter, "type_descriptor") and "process_value" not in vars(parameter):
                parameter.process_value = partial(_processed, parameter, parameter.process_value)
        return parameters


class PlainCommand(TakesPlainValues, typer.core.TyperCommand):
    """Such a command."""


def _processed(parameter: Any, by_parser: Callable[..., Any], context: Any, value: Any) -> Any:
    plain = _plain(value, parameter)
    if plain is _LEFT:
        return by_parser(context, value)
    return plain if parameter.callback is None else parameter.callback(context, parameter, plain)


def _plain(value: Any, parameter: Any) -> Any:
    """The value, if it is plain."""
    several, kind = parameter.multiple or parameter.nargs != 1, parameter.type_descriptor.annotation
    if value is None and not parameter.required:
        return () if several else None
    kind = next((one for one in (str, float, int, Path) if kind in (one, typing.Optional[one])), None)  # noqa: UP045
    if several or kind is None or parameter.type_descriptor.is_ranged:
        return _LEFT
    if type(value) is kind:
        return value
    if type(value) is not str:
        return _LEFT
    if kind is Path:
        return Path(value) if os.access(value, os.R_OK) or not os.path.lexists(value) else _LEFT
    pattern = _DECIMAL if kind is float else _WHOLE
    return kind(value) if pattern.fullmatch(value) else _LEFT
