"""Flags that several commands share: declared once, as the fields of a dataclass."""

import inspect
from collections.abc import Callable
from dataclasses import fields
from functools import wraps
from typing import Any

Command = Callable[..., Any]


def option_group(name: str, declared: type[Any]) -> Callable[[Command], Command]:
    """Give a command the fields of `declared` as flags; it receives them as one value, its argument `name`.

    The annotation of a field is that of the flag for typer; its default is that of the flag.
    """
    shared = [
        inspect.Parameter(f.name, inspect.Parameter.KEYWORD_ONLY, default=f.default, annotation=f.type)
        for f in fields(declared)
    ]

    def decorate(command: Command) -> Command:
        own = [p for p in inspect.signature(command).parameters.values() if p.name != name]

        @wraps(command)
        def call(**arguments: Any) -> Any:
            flags = declared(**{f.name: arguments.pop(f.name) for f in fields(declared)})
            return command(**{name: flags}, **arguments)

        call.__signature__ = inspect.Signature(own + shared)  # type: ignore[attr-defined]
        call.__annotations__ = {p.name: p.annotation for p in own + shared}
        return call

    return decorate
