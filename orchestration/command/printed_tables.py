"""Tables on standard output, with a caption, in CSV, Markdown or LaTeX."""

import csv
import io
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from orchestration.command.options import option
from orchestration.foundation.basics.errors import UsageError

FORMATS = ("csv", "markdown", "latex")
MAX_ROWS = 40
"""Most rows of a table in LaTeX that stands on one page"""
_NARROW = r"\footnotesize\setlength{\tabcolsep}{4pt}"
TABLE = option("--table", "Print the cells with their intervals as a table of that format.", "|".join(FORMATS))


@dataclass(frozen=True, kw_only=True)
class PrintedTable:
    """A table of texts for a paper, and the rows of numbers behind it."""

    caption: str
    heads: Sequence[str]
    rows: Sequence[Sequence[str]]
    numbers: Sequence[Mapping[str, Any]]
    """Numbers of CSV, by column"""


def expect_format(form: str | None) -> None:
    """Raise `UsageError` for an unknown format."""
    if form not in (None, *FORMATS):
        raise UsageError(f"--table {form}: expected {', '.join(FORMATS[:-1])} or {FORMATS[-1]}")


def lines(table: PrintedTable, form: str) -> Iterator[str]:
    """The lines of a table; CSV has the numbers, without a caption."""
    if form == "csv":
        text = io.StringIO()
        writer = csv.DictWriter(text, fieldnames=[*table.numbers[0]] if table.numbers else [], lineterminator="\n")
        writer.writeheader()
        writer.writerows(table.numbers)
        yield from text.getvalue().splitlines()
    elif form == "markdown":
        for row in (table.heads, ["---"] * len(table.heads), *table.rows):
            yield "| " + " | ".join(cell.replace("|", r"\|") for cell in row) + " |"
        yield ""
        yield table.caption
    elif len(table.rows) <= MAX_ROWS:
        yield r"\begin{table}  % needs \usepackage{booktabs}"
        yield rf"\centering{_NARROW}"
        yield rf"\caption{{{_latex(table.caption)}}}"
        yield r"\begin{tabular}{" + "l" * len(table.heads) + "}"
        yield from _latex_head(table)
        yield from map(_latex_row, table.rows)
        yield r"\bottomrule"
        yield r"\end{tabular}"
        yield r"\end{table}"
    else:
        yield rf"{{{_NARROW}"
        yield r"\begin{longtable}{" + "l" * len(table.heads) + r"}  % needs \usepackage{booktabs,longtable}"
        yield rf"\caption{{{_latex(table.caption)}}} \\"
        yield from _latex_head(table)
        yield r"\endfirsthead"
        yield from _latex_head(table)
        yield r"\endhead"
        yield r"\bottomrule"
        yield r"\endfoot"
        yield from map(_latex_row, table.rows)
        yield r"\end{longtable}}"


def _latex_head(table: PrintedTable) -> Iterator[str]:
    yield r"\toprule"
    yield _latex_row(table.heads)
    yield r"\midrule"


_OF_TEX: Mapping[int, str] = {ord(character): f"\\{character}" for character in "&%$#_{}"} | {
    ord("\\"): r"\textbackslash{}", ord("~"): r"\textasciitilde{}", ord("^"): r"\textasciicircum{}", ord("<"): "$<$",
    ord(">"): "$>$",
}  # fmt: skip


def _latex_row(row: Sequence[str]) -> str:
    return " & ".join(f"{{{text}}}" if (text := _latex(cell)).startswith("[") else text for cell in row) + r" \\"


def _latex(text: str) -> str:
    """A text with what TeX would read otherwise, minus signs too."""
    return re.sub(r"(?<!\S)(\[?)-(?=\d)", r"\1$-$", text.translate(_OF_TEX))
