"""The page of the command line: every command and every flag with its help, as the program has them."""

import re
from collections.abc import Iterator
from typing import Any

import typer.main

from orchestration.command.cli import app

INTRODUCTION = """\
# Command line

`quadcosim COMMAND --help` says on a terminal what is said here.

"""


def page() -> str:
    """The Markdown of the page."""
    group = typer.main.get_command(app)
    commands: dict[str, Any] = group.commands  # type: ignore[attr-defined]
    listed = "".join(f"- [`{name}`](#{name}): {_sentence(command.help)}\n" for name, command in commands.items())
    return INTRODUCTION + listed + "".join(_command(name, command) for name, command in commands.items())


def _command(name: str, command: Any) -> str:
    context = command.make_context(name, [], resilient_parsing=True)
    usage = " ".join(["quadcosim", name, *command.collect_usage_pieces(context)])
    panels: dict[str, list[Any]] = {}
    for parameter in command.get_params(context):
        if not getattr(parameter, "hidden", False):
            panel = getattr(parameter, "rich_help_panel", None)
            kind = "Arguments" if parameter.param_type_name == "argument" else "Options"
            panels.setdefault(panel or kind, []).append(parameter)
    tables = "".join(_table(title, parameters, context) for title, parameters in panels.items())
    return f"\n## {name}\n\n```text\n{usage}\n```\n\n{_escaped(command.help or '')}\n{tables}"


def _table(title: str, parameters: list[Any], context: Any) -> str:
    rows = "".join(_rows(parameters, context))
    return f"\n| {title} | |\n|---|---|\n{rows}"


def _rows(parameters: list[Any], context: Any) -> Iterator[str]:
    for parameter in parameters:
        record = parameter.get_help_record(context) or (parameter.name, parameter.help)
        names, said = (_escaped(str(part)) for part in record)
        yield f"| `{names}` | {said} |\n"


def _sentence(text: str | None) -> str:
    """Help as one line."""
    return _escaped(" ".join((text or "").split()))


def _escaped(text: str) -> str:
    """Text in which nothing is taken for Markdown or for a border of a table."""
    return re.sub(r"([|<*_])", r"\\\1", text)
