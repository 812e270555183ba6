"""Tables of the generated pages."""

import re
from collections.abc import Sequence
from html import escape


def table(rows: Sequence[Sequence[str]], heading: str = "", columns: Sequence[str] = ()) -> str:
    """A table of cells in HTML; `heading` is above all columns, `columns` are their headings."""
    lines = ["".join(f"<td>{cell}</td>" for cell in row) for row in rows]
    if columns:
        lines.insert(0, "".join(f"<th>{column}</th>" for column in columns))
    elif heading:
        lines.insert(0, f'<th colspan="{len(rows[0])}">{heading}</th>')
    body = "\n".join(f"<tr>{line}</tr>" for line in lines)
    return f"<table data-made>\n{body}\n</table>\n\n"


def inline_html(text: str) -> str:
    """A text of the code as HTML; parts in backticks become code."""
    return re.sub(r"`([^`]+)`", r"<code>\1</code>", escape(text, quote=False))
