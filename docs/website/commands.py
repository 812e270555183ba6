"""The commands on the page of the command line: each with its help and its flags, from the program."""

from html import escape
from typing import Any

from docs.website.tables import inline_html, table
from orchestration.command.cli import command_line


def section() -> str:
    """The Markdown that follows the text of `docs/commands.md` on the site."""
    group: Any = command_line()
    listed = [(f'<a href="#{name}"><code>{name}</code></a>', _first(each.help)) for name, each in _commands(group)]
    return "\n## Every command\n\n" + table(listed) + "".join(_section(name, each) for name, each in _commands(group))


def _commands(group: Any) -> list[tuple[str, Any]]:
    return [(name, command) for name, command in group.commands.items() if not command.hidden]


def _section(name: str, command: Any) -> str:
    context = command.make_context(name, [], resilient_parsing=True)
    usage = " ".join(["quadcosim", name, *command.collect_usage_pieces(context)])
    panels: dict[str, list[tuple[str, str]]] = {"Arguments": [], "Options": []}
    for parameter in command.get_params(context):
        if parameter.name == "help" or getattr(parameter, "hidden", False):
            continue
        kind = "Arguments" if parameter.param_type_name == "argument" else "Options"
        names, text = parameter.get_help_record(context)
        panel = panels.setdefault(getattr(parameter, "rich_help_panel", None) or kind, [])
        panel.append((f"<code>{escape(names)}</code>", inline_html(text)))
    tables = "".join(table(rows, heading=title) for title, rows in panels.items() if rows)
    return f"\n### {name}\n\n```text\n{usage}\n```\n\n{escape(command.help or '', quote=False)}\n\n{tables}"


def _first(text: str | None) -> str:
    """The first sentence of a help text, for the list of commands."""
    return inline_html((text or "").split("\n\n")[0].split(". ")[0].rstrip("."))
