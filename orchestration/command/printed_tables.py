"""Tables on standard output, with a caption, in CSV, Markdown or LaTeX."""

import csv
import io
import math
import re
import textwrap
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from decimal import ROUND_HALF_UP, Decimal
from itertools import groupby
from typing import Any

from orchestration.command.options import option
from orchestration.foundation.basics.errors import UsageError

FORMATS = ("csv", "markdown", "latex")
MAX_ROWS = 40
"""Most rows of a table in LaTeX, names above rows among them, as fit on one page"""
LONG = 12
"""Most letters of a name in a leading column of a table in LaTeX; a longer one stands above its rows"""
NARROW, WIDE = 40, 68
"""Most letters of a row of a table in LaTeX in `footnotesize`, as a column and the page of an article are wide"""
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
    """As wide as the page, or a column if it fits; more than `MAX_ROWS` rows in several tables with one number."""
    count = _leading(table)  # columns that stand above their rows
    heads, rows = table.heads[count:], [row[count:] for row in table.rows]
    letters, head = _letters(heads, rows), _latex_head(heads, rows)
    size, apart = ("footnotesize", 4) if letters <= WIDE else ("scriptsize", 3)
    above = [tuple(row[:count]) for row in table.rows]
    name = "table" if max([letters, *(len(", ".join(names)) for names in above)]) <= NARROW else "table*"
    starts = _pages(above)
    for start, end in zip(starts, [*starts[1:], len(rows)]):
        yield rf"\begin{{{name}}}  % needs \usepackage{{booktabs}}"
        yield rf"\centering\{size}\setlength{{\tabcolsep}}{{{apart}pt}}"
        yield from [rf"\caption{{{_latex(table.caption)}}}"] if start == 0 else _CONTINUED
        yield from [rf"\begin{{tabular}}{{@{{}}{'l' * len(heads)}@{{}}}}", *head]
        for place in range(start, end):
            if count and (place == start or above[place] != above[place - 1]):
                yield from [] if place == start else [r"\midrule"]
                yield rf"\multicolumn{{{len(heads)}}}{{l}}{{{_latex(', '.join(above[place]))}}} \\"
            yield _latex_cells([_latex(cell) for cell in rows[place]])
        yield from [r"\bottomrule", r"\end{tabular}", rf"\end{{{name}}}"]


_CONTINUED = (r"\addtocounter{table}{-1}", r"\caption{(continued)}")


def _pages(above: Sequence[tuple[str, ...]]) -> list[int]:
    """The rows with which pages begin; a block of rows with the same names above them takes a row more."""
    starts, filled = [0], 0
    for place, names in enumerate(above):
        is_new = bool(names) and (place == 0 or names != above[place - 1])
        if filled + 1 + is_new > MAX_ROWS:
            starts, filled, is_new = [*starts, place], 0, bool(names)
        filled += 1 + is_new
    return starts


def _leading(table: PrintedTable) -> int:
    """The number of leading columns, the last of them of long names, that blocks of rows have in common."""
    for count in range(len(table.heads) - 1, 0, -1):
        names = [tuple(row[:count]) for row in table.rows]
        blocks = len([*groupby(names)])
        if len({*names}) == blocks < len(names) and max(len(name[-1]) for name in names) > LONG:
            return count
    return 0


def _widths(rows: Sequence[Sequence[str]]) -> list[int]:
    return [max(map(len, column)) for column in zip(*rows)]


def _letters(heads: Sequence[str], rows: Sequence[Sequence[str]]) -> int:
    """The letters of a row as wide as all columns, whose heads are broken between words."""
    return sum(_widths([[max(head.split(), key=len, default="") for head in heads], *rows]))


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


def to_digits(value: float | None, low: float | None, high: float | None, digits: int) -> str:
    """A number to some digits with its interval to as many decimals, or digits where these are large or small numbers.

    A dash for one that is not known, ? for an end, None or nan both.
    """
    known = [None if end is None or math.isnan(end) else end for end in (value, low, high)]
    if known[0] is None:
        return "-"
    size = abs(known[0]) or max((abs(end) for end in known if end), default=1.0)
    decimals = max(0, digits - 1 - math.floor(math.log10(size))) if 1e-4 <= size < 1e6 else None
    ends = [
        None if end is None else f"{end:.{digits}g}" if decimals is None else _signed(end, decimals) for end in known
    ]
    return f"{ends[0]}" if ends[1] is ends[2] is None else f"{ends[0]} [{ends[1] or '?'}, {ends[2] or '?'}]"


def decimals_of(count: int) -> int:
    """The decimals that a share of so many runs needs: with fewer, one run in them would round to none."""
    return 2 if count <= 100 else math.ceil(math.log10(count))


def _signed(value: float, decimals: int) -> str:
    """A number with some decimals, half rounded away from 0, or as many as show that it is not 0."""
    if abs(value) >= 0.5 * 10.0**-decimals:
        return str(Decimal(repr(float(value))).quantize(Decimal(1).scaleb(-decimals), ROUND_HALF_UP))
    return f"{value:.1g}" if abs(value) > 1e-9 else f"{0.0:.{decimals}f}"
