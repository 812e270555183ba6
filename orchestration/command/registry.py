"""How a function becomes a command: it answers, and what every command has is added here."""

import shlex
from collections.abc import Callable, Sequence
from functools import wraps
from typing import Any

import typer

from orchestration.basics import terminal
from orchestration.command.answer import Answer
from orchestration.command.output_options import Manners
from orchestration.command.shared_flags import takes

FLY, STUDY, FMUS, TOOLS = "Run", "Study", "FMUs", "Other tools"
"""Groups of commands in the help"""

arguments: Sequence[str] = ()
"""What the command line was started with"""
manners = Manners()
"""Of the command at hand: what stands before it, and then what stands behind it too"""


def behave(given: Manners, *, anew: bool = False) -> None:
    """Add flags to those that hold; `anew`: instead of them."""
    global manners
    manners = given if anew else manners.joined(given)
    manners.take_hold()


def add(app: typer.Typer, group: str, *commands: Callable[..., Answer]) -> None:
    """Add commands to the command line, in a group of its help."""
    for command in commands:
        app.command(rich_help_panel=group)(_answering(command))


def _answering(command: Callable[..., Answer]) -> Callable[..., None]:
    @takes("manners", Manners)
    @wraps(command)
    def call(manners: Manners, **given: Any) -> None:
        behave(manners)
        terminal.detail(shlex.join(["quadcosim", *arguments]))
        give(command(**given))

    return call


def give(answer: Answer) -> None:
    """Print what a command answers, as the flags have it."""
    text = answer.as_json if manners.as_json else "\n".join(answer.lines)
    if text:
        print(text)
        terminal.note(text)
    if not answer.good:
        raise typer.Exit(1)
