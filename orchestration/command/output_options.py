"""The output flags of every command."""

import logging
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Annotated, Any

import typer

from orchestration.foundation.basics import terminal
from orchestration.foundation.basics.errors import UsageError


def _option(*names: str, text: str, metavar: str = "") -> Any:
    return typer.Option(*names, help=text, rich_help_panel="Output", show_default=False, metavar=metavar)


@dataclass(frozen=True, kw_only=True)
class OutputOptions:
    """The output flags; raises `UsageError` for flags that contradict each other."""

    as_json: Annotated[
        bool, _option("--json", text="Print the result as one JSON document; all else goes to standard error.")
    ] = False
    quiet: Annotated[bool, _option("--quiet", "-q", text="Print only the result, warnings and errors.")] = False
    verbose: Annotated[bool, _option("--verbose", "-v", text="Also report each step.")] = False
    log: Annotated[
        Path | None, _option("--log", metavar="FILE", text="Append all output and steps to FILE, with times.")
    ] = None
    debug: Annotated[bool, _option("--debug", text="Print the traceback of an error.")] = False

    def __post_init__(self) -> None:
        if self.quiet and self.verbose:
            raise UsageError("--quiet --verbose: expected one of them")

    def joined(self, other: "OutputOptions") -> "OutputOptions":
        """These and those of `other`: the flags before a command and those after it."""
        return OutputOptions(**{f.name: getattr(other, f.name) or getattr(self, f.name) for f in fields(self)})

    def apply(self) -> None:
        """Configure messages by these flags; raises `OSError` for a log that cannot be written."""
        terminal.configure(logging.DEBUG if self.verbose else logging.WARNING if self.quiet else logging.INFO, self.log)
