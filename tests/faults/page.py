"""What `make faults` found: the rows in `docs/data/faults.json`, the table of `docs/design/faults.md`."""

import json
from collections import Counter
from typing import Any

from tests.places import ROOT

DATA = ROOT / "docs/data/faults.json"
PAGE = ROOT / "docs/design/faults.md"
BEGIN, END = "<!-- cases -->\n", "<!-- end -->\n"
GOOD = ("old", "new")


def as_json(rows: list[dict[str, Any]]) -> str:
    """The rows, one a line."""
    kept = ({key: row[key] for key in ("command", "operation", "n", "outcome")} for row in rows)
    return "[\n" + ",\n".join(json.dumps(row) for row in kept) + "\n]\n"


def page(text: str, rows: list[dict[str, Any]]) -> str:
    """The page of that text with the counts of these rows."""
    before, _, rest = text.partition(BEGIN)
    return before + BEGIN + _table(rows) + END + rest.partition(END)[2]


def _table(rows: list[dict[str, Any]]) -> str:
    """All commands together, and those that left files otherwise than as before or new."""
    lines = ["", "| command | cases | files as before | new files | else |", "| --- | --- | --- | --- | --- |"]
    bad = dict.fromkeys(row["command"] for row in rows if row["outcome"] not in GOOD)
    counted = [(name, Counter(row["outcome"] for row in rows if row["command"] == name)) for name in bad]
    for name, counts in [*counted, ("all", Counter(row["outcome"] for row in rows))]:
        others = ", ".join(f"{counts[each]} {each}" for each in counts if each not in GOOD)
        lines.append(f"| {name} | {counts.total()} | {counts['old']} | {counts['new']} | {others} |")
    return "\n".join([*lines, "", ""])


def write(rows: list[dict[str, Any]]) -> None:
    """Write both."""
    DATA.write_text(as_json(rows), encoding="utf-8")
    PAGE.write_text(page(PAGE.read_text(encoding="utf-8"), rows), encoding="utf-8")
