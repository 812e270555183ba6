"""Tables of the pages that are made of the code."""

import re
from collections.abc import Sequence
from html import escape


def table(rows: Sequence[Sequence[str]], heading: str = "", columns: Sequence[str] = ()) -> str:
    """Rows of cells that are HTML already; `heading` stands above all columns, `columns` above each."""
    lines = ["".join(f"<td>{cell}</td>" for cell in row) for row in rows]
    if columns:
        lines.insert(0, "".join(f"<th>{column}</th>" for column in columns))
    elif heading:
        lines.insert(0, f'<th colspan="{len(rows[0])}">{heading}</th>')
    body = "\n".join(f"<tr>{line}</tr>" for line in lines)
    return f"<table data-made>\n{body}\n</table>\n\n"


def words(text: str) -> str:
    """A text of the code as HTML; what it has in backticks is code there too."""
    return re.sub(r"`([^`]+)`", r"<code>\1</code>", escape(text, quote=False))
