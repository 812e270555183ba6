"""The flag of every command that may build FMUs, and the question where it is not given."""

import sys
from collections.abc import Callable
from dataclasses import dataclass
from functools import wraps
from typing import Annotated, Any

import typer

from orchestration.command.shared_flags import takes


@dataclass(frozen=True, kw_only=True)
class BuildFlag:
    """What was given on the command line."""

    build: Annotated[
        bool,
        typer.Option(
            "--build",
            help="Allow building FMUs from foreign modules beside a system file (it runs them); remembered.",
            show_default=False,
        ),
    ] = False


def builds(command: Callable[..., Any]) -> Callable[..., Any]:
    """Give a command the flag, which holds as long as it runs."""

    @takes("given", BuildFlag)
    @wraps(command)
    def call(given: BuildFlag, **others: Any) -> Any:
        if given.build:
            from orchestration.building import consent

            consent.allow()
        return command(**others)

    return call


def ask(question: str) -> bool:
    """Whether somebody at a terminal says yes; nobody says no."""
    if not (sys.stdin.isatty() and sys.stderr.isatty()):
        return False
    print(f"{question} [y/N] ", end="", file=sys.stderr, flush=True)
    return sys.stdin.readline().strip().lower() in ("y", "yes")
