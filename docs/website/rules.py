"""The rules on the page of validation: each with the first line of its docstring."""

from collections.abc import Callable, Sequence

from docs.website.tables import inline_html, table
from orchestration.components.checks.validation import rules
from orchestration.components.checks.validation.finding import name_of


def section() -> str:
    """The Markdown that follows the text of `docs/validation.md` on the site."""
    return (
        f"\n## Rules for every FMU\n\n{_table(rules.STANDARD)}"
        f"\n## Rules for FMUs that quadcosim built\n\n{_table(rules.OURS)}"
    )


def _table(of: Sequence[Callable[..., object]]) -> str:
    rows = [(f"<code>{name_of(rule)}</code>", inline_html((rule.__doc__ or "").splitlines()[0])) for rule in of]
    return table(rows, columns=("Rule", "What it checks"))
