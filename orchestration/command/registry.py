"""Turns functions into commands: adds the flags of every command and prints their results."""

import shlex
from collections.abc import Callable, Sequence
from functools import wraps
from typing import Any

import typer

from orchestration.command.command_result import CommandResult
from orchestration.command.option_group import option_group
from orchestration.command.output_options import OutputOptions
from orchestration.foundation.basics import terminal

RUN, STUDY, FMUS, TOOLS = "Run", "Study", "FMUs", "Other tools"
"""Groups of commands in the help"""

arguments: Sequence[str] = ()
"""of the command line"""
output_options = OutputOptions()
"""of the current command: those before it, then also those after it"""


def set_output_options(options: OutputOptions, *, anew: bool = False) -> None:
    """Add flags to the current ones, or with `anew` replace them."""
    global output_options
    output_options = options if anew else output_options.joined(options)
    output_options.apply()


def add(app: typer.Typer, group: str, *commands: Callable[..., CommandResult]) -> None:
    """Add commands to the command line, in a group of its help."""
    for command in commands:
        app.command(rich_help_panel=group)(_printing(command))


def _printing(command: Callable[..., CommandResult]) -> Callable[..., None]:
    @option_group("output_options", OutputOptions)
    @wraps(command)
    def call(output_options: OutputOptions, **others: Any) -> None:
        set_output_options(output_options)
        terminal.detail(shlex.join(["quadcosim", *arguments]))
        print_result(command(**others))

    return call


def print_result(result: CommandResult) -> None:
    """Print the result of a command in the form of the flags."""
    text = result.as_json if output_options.as_json else "\n".join(result.lines)
    if text:
        print(text)
        terminal.note(text)
    if not result.good:
        raise typer.Exit(1)
