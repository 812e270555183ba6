"""`documentation/index.html` of an FMU: the part that its author wrote, and tables of what the slave declares.

Used only when an FMU is built: a slave must not import it, since an FMU bundles what its slave imports. The page is
well-formed XML and self-contained, since the viewers of tools load no other files.
"""

import itertools
import posixpath
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from html import escape
from pathlib import Path
from string import Template
from typing import Any

from fmu_kit.variables import Variable
from fmu_kit.write_description import PYTHON_REQUIRED

TEMPLATE = Path(__file__).with_name("page.html")
"""The template of the page, around the hand-written part."""
IN_PYTHON = Path(__file__).with_name("needs.html")
"""The requirements of an FMU whose slave runs in Python."""


@dataclass(frozen=True, kw_only=True)
class BuildNotes:
    """What the page says of how an FMU was built."""

    version: int = 2
    """Version of FMI"""
    needs: Path
    """the template of its requirements and of where its sources are"""
    source: str
    """the link from the page to the module of the slave"""
    status: str
    """FMI status of a call that fails"""
    afterwards: str
    """advice for after a failure"""


HEADINGS = {
    "input": "Inputs",
    "output": "Outputs",
    "parameter": "Parameters",
    "local": "Locals",
    "constant": "Constants, fixed when the FMU was built",
}
"""The headings of the page in order, by causality; constants are separate."""


def to_html(slave: Any, notes: BuildNotes, fragment: str = "") -> str:
    """The page of a `Slave` class.

    `fragment` is the hand-written part: sections of XHTML, whose relative links start at the folder of the sources.
    """
    experiment = slave.default_experiment
    values = {
        "model": escape(slave.__name__),
        "whose": escape(_attribution(slave)),
        "licence": escape(slave.license) or "that its author names",
        "python": escape(PYTHON_REQUIRED),
        "source": escape(notes.source),
        "fmi": str(notes.version),
        "description": escape(slave.description),
        "start": _number(experiment.start_time),
        "stop": _number(experiment.stop_time),
        "step": _number(experiment.step_size),
        "status": notes.status,
        "afterwards": escape(notes.afterwards),
        "contents": "".join(f"{link} · " for link in _contents(fragment)),
        "fragment": _relocated(fragment, posixpath.dirname(notes.source)).strip(),
        "variables": "\n".join(variable_tables(slave.variables)),
        "categories": _table(
            ("Category", "Messages"), [(_code(k), escape(v)) for k, v in slave.log_categories.items()]
        ),
    }
    needs = Template(notes.needs.read_text(encoding="utf-8")).substitute(values)
    return Template(TEMPLATE.read_text(encoding="utf-8")).substitute(values, needs=needs)


def _attribution(slave: Any) -> str:
    """Author, copyright and licence, as far as the slave names them."""
    named = {"Author": slave.author, "Copyright": slave.copyright, "Licence": slave.license}
    return "".join(f" {what}: {text}." for what, text in named.items() if text)


def files_linked(page: str) -> list[str]:
    """The links of a page to files, not to a section or to the web."""
    return re.findall(r'\bhref="(?!#|[a-z]+:)([^"#]*)', page)


def _contents(fragment: str) -> list[str]:
    """Links to the sections of the hand-written part."""
    return [f'<a href="#{name}">{title}</a>' for name, title in re.findall(r'<h2 id="([^"]+)">(.*?)</h2>', fragment)]


def _relocated(fragment: str, folder: str) -> str:
    """The fragment with its links to files starting at `folder`."""
    return re.sub(r'\bhref="(?!#|[a-z]+:)', f'href="{escape(folder)}/', fragment)


def variable_tables(variables: Sequence[Variable]) -> Iterator[str]:
    """The HTML of a heading and a table for each causality that occurs, and for constants."""
    for kind, heading in HEADINGS.items():
        chosen = [v for v in variables if kind == ("constant" if v.variability == "constant" else v.causality)]
        if chosen:
            yield f"<h3>{heading} ({len(chosen)})</h3>"
            columns = ("Name", "Unit", "Start", "Min", "Max", "Items", "Variability", "Description")
            yield _table(columns, [_row(alike) for alike in _vectors(chosen)])


def _vectors(variables: Sequence[Variable]) -> Iterator[list[Variable]]:
    """Variables in groups: neighbours that differ only in the last part of the name and in the start value."""

    def shared(variable: Variable) -> tuple[str, Variable]:
        vector = variable.name.rpartition(".")[0] or variable.name
        return variable.type, replace(variable, name=vector, start=0.0)

    for _, alike in itertools.groupby(variables, shared):
        yield list(alike)


def _row(alike: list[Variable]) -> tuple[str, ...]:
    first = alike[0]
    vector = first.name.rpartition(".")[0]
    axes = ",".join(variable.name.rpartition(".")[2] for variable in alike)
    starts = [_start(variable) for variable in alike if variable.has_start]
    return (
        _code(f"{vector}.{{{axes}}}" if len(alike) > 1 else first.name),
        escape(first.unit) if first.unit is not None else first.type,
        starts[0] if len(set(starts)) == 1 else ", ".join(starts),
        _number(first.minimum) if first.above is None else f"&gt; {_number(first.above)}",
        _number(first.maximum),
        ", ".join(f"{value}&#160;{_code(name)}" for name, value in first.items.items()),
        first.variability,
        escape(first.description),
    )


def _table(columns: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A table of cells in HTML; empty columns are left out."""
    kept = [i for i in range(len(columns)) if any(row[i] for row in rows)]
    lines = ["".join(f"<th>{columns[i]}</th>" for i in kept)]
    lines += ["".join(f"<td>{row[i]}</td>" for i in kept) for row in rows]
    return "\n".join(['<div class="wide"><table>', *(f"<tr>{line}</tr>" for line in lines), "</table></div>"])


def _code(text: str) -> str:
    return f"<code>{escape(text)}</code>"


def _start(variable: Variable) -> str:
    """The start value; for an Enumeration, the name of its item."""
    items = {value: name for name, value in variable.items.items()}
    return _code(items[int(variable.start)]) if items else _number(variable.start)


def _number(value: float | int | bool | None) -> str:
    """A number in its shortest exact form; empty for None."""
    if value is None:
        return ""
    if isinstance(value, bool):
        return str(value).lower()
    short = f"{value:g}"
    return short if float(short) == value else repr(value)
