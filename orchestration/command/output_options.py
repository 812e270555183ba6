"""The flags that every command has: how it talks, and to whom."""

import logging
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Annotated, Any

import typer

from orchestration.basics import terminal
from orchestration.basics.errors import UsageError


def _option(*names: str, text: str, metavar: str = "") -> Any:
    return typer.Option(*names, help=text, rich_help_panel="Output", show_default=False, metavar=metavar)


@dataclass(frozen=True, kw_only=True)
class Manners:
    """What was given on the command line; raises `UsageError` for flags that contradict each other."""

    as_json: Annotated[
        bool, _option("--json", text="Print the result as one JSON document; all else goes to standard error.")
    ] = False
    quiet: Annotated[bool, _option("--quiet", "-q", text="Print only the result, warnings and errors.")] = False
    verbose: Annotated[bool, _option("--verbose", "-v", text="Also report each step.")] = False
    log: Annotated[
        Path | None, _option("--log", metavar="FILE", text="Append all output and steps to FILE, with times.")
    ] = None
    debug: Annotated[bool, _option("--debug", text="Show where in the program an error came from.")] = False

    def __post_init__(self) -> None:
        if self.quiet and self.verbose:
            raise UsageError("--quiet --verbose: expected one of them")

    def joined(self, other: "Manners") -> "Manners":
        """These and those of `other`: what stands before a command and what stands behind it."""
        return Manners(**{f.name: getattr(other, f.name) or getattr(self, f.name) for f in fields(self)})

    def take_hold(self) -> None:
        """From now on messages go where these flags say; raises `OSError` for a log that cannot be written."""
        terminal.configure(logging.DEBUG if self.verbose else logging.WARNING if self.quiet else logging.INFO, self.log)
