"""Tables on standard output, with a caption, in CSV, Markdown or LaTeX."""

import csv
import io
import math
import re
import textwrap
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from orchestration.command.options import option
from orchestration.foundation.basics.errors import UsageError

FORMATS = ("csv", "markdown", "latex")
MAX_ROWS = 40
"""Most rows of a table in LaTeX that stands on one page"""
LONG = 12
"""Most letters of a name in the first column of a table in LaTeX; a longer one stands above its rows"""
WIDE = 68
"""Most letters of a row of a table in LaTeX in `footnotesize`, as the page of an article is wide"""
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
    else:
        yield from _latex_lines(table)


def _latex_lines(table: PrintedTable) -> Iterator[str]:
    blocks = _blocks(table)
    heads, rows = table.heads, table.rows
    if blocks:  # the first column stands above its rows
        heads, rows = heads[1:], [row[1:] for row in rows]
    columns, head = "l" * len(heads), _latex_head(heads, rows)
    size = rf"\{_size(heads, rows)}\setlength{{\tabcolsep}}{{4pt}}"
    body = [_latex_row(row) for row in rows]
    for place, name in reversed(blocks):
        rule = [r"\midrule"] if place else []
        body[place:place] = [*rule, rf"\multicolumn{{{len(heads)}}}{{l}}{{{_latex(name)}}} \\*"]
    if len(table.rows) <= MAX_ROWS:
        yield r"\begin{table}  % needs \usepackage{booktabs}"
        yield rf"\centering{size}"
        yield rf"\caption{{{_latex(table.caption)}}}"
        yield rf"\begin{{tabular}}{{{columns}}}"
        yield from [*head, *(line.replace(r"\\*", r"\\") for line in body)]
        yield r"\bottomrule"
        yield r"\end{tabular}"
        yield r"\end{table}"
    else:
        yield rf"{{{size}"
        yield rf"\begin{{longtable}}{{{columns}}}  % needs \usepackage{{booktabs,longtable}}"
        yield rf"\caption{{{_latex(table.caption)}}} \\"
        yield from [*head, r"\endfirsthead", *head, r"\endhead"]
        yield r"\bottomrule"
        yield r"\endfoot"
        yield from body
        yield r"\end{longtable}}"


def _blocks(table: PrintedTable) -> list[tuple[int, str]]:
    """The first row of each block of rows that have a long name in common in their first column, and that name."""
    names = [row[0] for row in table.rows]
    first = [place for place, name in enumerate(names) if place == 0 or name != names[place - 1]]
    is_long = max(map(len, names), default=0) > LONG
    is_block = is_long and len(table.heads) > 1 and len({*names}) == len(first) < len(names)
    return [(place, names[place]) for place in first] if is_block else []


def _widths(rows: Sequence[Sequence[str]]) -> list[int]:
    return [max(map(len, column)) for column in zip(*rows)]


def _size(heads: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """The larger of two sizes, if the columns fit on a page in it."""
    words = [max(head.split(), key=len, default="") for head in heads]
    return "footnotesize" if sum(_widths([words, *rows])) <= WIDE else "scriptsize"


def _latex_head(heads: Sequence[str], rows: Sequence[Sequence[str]]) -> list[str]:
    """The head between rules; a name wider than its column stands in several lines."""
    texts = []
    for head, width in zip(heads, _widths(rows) or [0] * len(heads)):
        most = max([width, *map(len, head.split())])
        parts = textwrap.wrap(head, most, break_long_words=False, break_on_hyphens=False)
        inside = r" \\ ".join(f"{{{_latex(part)}}}" for part in parts)  # in braces: TeX takes a [ after \\ otherwise
        texts.append(rf"\shortstack[l]{{{inside}}}" if len(parts) > 1 else _latex(head))
    return [r"\toprule", _latex_cells(texts), r"\midrule"]


_OF_TEX: Mapping[int, str] = {ord(character): f"\\{character}" for character in "&%$#_{}"} | {
    ord("\\"): r"\textbackslash{}", ord("~"): r"\textasciitilde{}", ord("^"): r"\textasciicircum{}", ord("<"): "$<$",
    ord(">"): "$>$",
}  # fmt: skip


def _latex_row(row: Sequence[str]) -> str:
    return _latex_cells([_latex(cell) for cell in row])


def _latex_cells(texts: Sequence[str]) -> str:
    return " & ".join(f"{{{text}}}" if text.startswith("[") else text for text in texts) + r" \\"


def _latex(text: str) -> str:
    """A text with what TeX would read otherwise, minus signs too."""
    return re.sub(r"(?<!\S)(\[?)-(?=\d)", r"\1$-$", text.translate(_OF_TEX))


def with_interval(value: float, low: float, high: float, decimals: int) -> str:
    """A number with its interval, as far as it has one; a dash for one that is not known."""
    if math.isnan(value):
        return "-"
    known = "" if math.isnan(low) else f" [{_signed(low, decimals)}, {_signed(high, decimals)}]"
    return _signed(value, decimals) + known


def decimals_of(count: int) -> int:
    """The decimals that a share of so many runs needs: with fewer, one run in them would round to none."""
    return 2 if count <= 100 else math.ceil(math.log10(count))


def _signed(value: float, decimals: int) -> str:
    """A number with some decimals, or as many as show that it is not 0."""
    if abs(value) >= 0.5 * 10.0**-decimals:
        return f"{value:.{decimals}f}"
    return f"{value:.1g}" if abs(value) > 1e-9 else f"{0.0:.{decimals}f}"
