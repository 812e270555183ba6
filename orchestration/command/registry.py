"""What every command has: flags declared as fields of dataclasses, those of output and of building, and a result."""

import inspect
import json
import logging
import os
import re
import shlex
import sys
import typing
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, fields
from functools import partial, wraps
from pathlib import Path, PurePath
from typing import Annotated, Any

import typer
import typer.core

from orchestration.command.options import option
from orchestration.foundation.basics import terminal
from orchestration.foundation.basics.documents import plain
from orchestration.foundation.basics.errors import UsageError


@dataclass(frozen=True, kw_only=True)
class CommandResult:
    """Printed to standard output: with `--json` the document with the verdict, else the verdict and the lines."""

    document: object
    """Numbers, texts, booleans, lists, mappings, paths and dataclasses of them"""
    lines: Sequence[str]
    verdict: str | None = None
    """Answer of the command in a sentence (`verdicts.py`); None: it has only lines, as paths of files"""
    good: bool = True
    """false: exit code 1"""
    afterwards: Callable[[], None] | None = None
    """the rest of the answer, which takes long, once the result is printed"""

    @property
    def as_json(self) -> str:
        """The document as JSON; numbers that JSON lacks, such as infinity, are null."""
        document = plain(self.document)
        if self.verdict is not None and isinstance(document, dict):
            document = {"verdict": self.verdict, **document}
        return json.dumps(document, indent=2)

    @property
    def as_text(self) -> str:
        """The verdict, and the lines below it."""
        return "\n".join([*([] if self.verdict is None else [self.verdict]), *self.lines])


def result_of_files(paths: Iterable[PurePath]) -> CommandResult:
    """The paths of files that were written, one per line."""
    written = list(paths)
    return CommandResult(document={"files": written}, lines=[str(path) for path in written])


_output = partial(option, metavar="", panel="Output")


@dataclass(frozen=True, kw_only=True)
class OutputOptions:
    """The output flags; raises `UsageError` for flags that contradict each other."""

    as_json: Annotated[
        bool, _output("--json", "Print the result as one JSON document; all else goes to standard error.")
    ] = False
    quiet: Annotated[bool, _output("--quiet", "Print only the result, warnings and errors.", short="-q")] = False
    verbose: Annotated[bool, _output("--verbose", "Also report each step.", short="-v")] = False
    log: Annotated[
        Path | None, _output("--log", "Append all output and steps to FILE, with times.", metavar="FILE")
    ] = None
    debug: Annotated[bool, _output("--debug", "Print the traceback of an error.")] = False

    def __post_init__(self) -> None:
        if self.quiet and self.verbose:
            raise UsageError("--quiet --verbose: expected one of them")

    def joined(self, other: "OutputOptions") -> "OutputOptions":
        """These and those of `other`: the flags before a command and those after it."""
        return OutputOptions(**{f.name: getattr(other, f.name) or getattr(self, f.name) for f in fields(self)})

    def apply(self) -> None:
        """Configure messages by these flags; raises `OSError` for a log that cannot be written."""
        terminal.configure(logging.DEBUG if self.verbose else logging.WARNING if self.quiet else logging.INFO, self.log)


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


arguments: Sequence[str] = ()
"""Arguments of the command line"""
output_options = OutputOptions()
"""Output options of the current command: those before it, then also those after it"""


def set_output_options(options: OutputOptions, *, anew: bool = False) -> None:
    """Add flags to the current ones, or with `anew` replace them."""
    global output_options
    output_options = options if anew else output_options.joined(options)
    output_options.apply()


def add(app: typer.Typer, group: str, *commands: Callable[..., CommandResult]) -> None:
    """Add commands to the command line, in a group of its help."""
    for command in commands:
        app.command(cls=PlainCommand, rich_help_panel=group)(_printing(command))


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
    text = result.as_json if output_options.as_json else result.as_text
    if text:
        print(text, flush=result.afterwards is not None)
        terminal.note(text)
    if result.afterwards is not None:
        result.afterwards()
    if not result.good:
        raise typer.Exit(1)


@dataclass(frozen=True, kw_only=True)
class BuildFlag:
    """The flag on the command line."""

    build: Annotated[
        bool,
        option("--build", "Allow building FMUs from foreign code beside a system file (it runs it); remembered."),
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


def expect_positive(flag: str, value: float | None, unit: str) -> None:
    """Raise `UsageError` for a limit that is not positive."""
    if value is not None and not value > 0.0:
        raise UsageError(f"{flag} {value:g}: expected a positive number of {unit}")


_WHOLE = re.compile(r"[+-]?[0-9]{1,18}")
_DECIMAL = re.compile(r"[+-]?([0-9]{1,18}\.?|[0-9]{0,18}\.[0-9]{1,18})([eE][+-]?[0-9]{1,3})?")
_LEFT = object()


class TakesPlainValues:
    """A command of the parser, or a group of commands, that converts plain values itself, as that would load Pydantic.

    Only what the parser would accept, with the same result: values that are not given, texts, decimal numbers, and
    paths. All else is left to it, with its messages.
    """

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
