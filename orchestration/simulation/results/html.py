"""HTML of results for notebooks: a heading, a line of facts, and a table of values with their units."""

import html
from collections.abc import Iterable, Sequence

Row = tuple[str, str, str]
"""A quantity, its value and its unit"""
_CELL = "padding:0.15em 0.8em 0.15em 0;text-align:left"
_NUMBER = "padding:0.15em 0.8em 0.15em 0;text-align:right;font-variant-numeric:tabular-nums"
_COLOURS = {True: "#2f8f5b", False: "#b5323e", None: "#6b6b6b"}


def card(title: str, outcome: str | None, good: bool | None, facts: str, rows: Iterable[Row]) -> str:
    """A heading with the outcome, coloured by whether it is good, a line of facts, and a table; styles are inline."""
    badge = "" if outcome is None else (
        f' <span style="background:{_COLOURS[good]};color:#fff;border-radius:0.6em;padding:0.05em 0.6em">'
        f"{html.escape(outcome)}</span>"
    )  # fmt: skip
    return (
        f'<div><p style="margin:0"><strong>{html.escape(title)}</strong>{badge}</p>'
        f'<p style="margin:0.2em 0 0.4em">{html.escape(facts)}</p>{_table(list(rows))}</div>'
    )


def _table(rows: Sequence[Row]) -> str:
    lines = "".join(
        f'<tr><th scope="row" style="{_CELL};font-weight:normal">{html.escape(name)}</th>'
        f'<td style="{_NUMBER}">{html.escape(value)}</td><td style="{_CELL}">{html.escape(unit)}</td></tr>'
        for name, value, unit in rows
    )
    return f"<table>{lines}</table>" if rows else ""


def number(value: float | int | bool | str | None) -> str:
    """A value as text."""
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return f"{value:.5g}"
    return "–" if value is None else str(value)
