"""How a flag of a command is declared."""

import re
from typing import Any

import typer

from orchestration.command import completion


def option(
    name: str, text: str, metavar: str | None = None, *, short: str = "", panel: str | None = None, **options: Any
) -> Any:
    """A flag with its sentence in the help; words in small letters in its metavar are completed."""
    words = [word for word in re.split("[|,]", metavar or "") if word.islower()]
    if words and "autocompletion" not in options:
        options["autocompletion"] = completion.among(*words)
    return typer.Option(*filter(None, (name, short)), help=text, metavar=metavar, rich_help_panel=panel, **options)
