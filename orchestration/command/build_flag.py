"""The flag of every command that may build FMUs, and the question that is asked without it."""

import sys
from collections.abc import Callable
from dataclasses import dataclass
from functools import wraps
from typing import Annotated, Any

import typer

from orchestration.command.option_group import option_group


@dataclass(frozen=True, kw_only=True)
class BuildFlag:
    """The flag on the command line."""

    build: Annotated[
        bool,
        typer.Option(
            "--build",
            help="Allow building FMUs from foreign modules beside a system file (it runs them); remembered.",
            show_default=False,
        ),
    ] = False


def build_option(command: Callable[..., Any]) -> Callable[..., Any]:
    """Give a command the flag, which applies while the command runs."""

    @option_group("flag", BuildFlag)
    @wraps(command)
    def call(flag: BuildFlag, **others: Any) -> Any:
        if flag.build:
            from orchestration.components.building import consent

            consent.allow()
        return command(**others)

    return call


def ask(question: str) -> bool:
    """Ask on a terminal; True for yes, False without a terminal."""
    if not (sys.stdin.isatty() and sys.stderr.isatty()):
        return False
    print(f"{question} [y/N] ", end="", file=sys.stderr, flush=True)
    return sys.stdin.readline().strip().lower() in ("y", "yes")
