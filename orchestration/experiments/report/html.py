"""A report as one HTML file that contains its data and the code of the page."""

import html
import json
import re
from importlib import resources
from pathlib import Path

from fmu_kit.new_files import write_atomically
from orchestration.experiments.report.model import Report, as_json
from orchestration.simulation.figures import palette, shades

SCRIPTS = (
    "data.js", "words.js", "theme.js", "plots.js", "scene.js", "peaks.js", "timeplots.js", "map.js", "shares.js",
    "repeated.js", "run.js", "tables.js", "page.js",
)  # fmt: skip
"""Scripts in the order of loading; each depends only on those before it"""
FIGURES = {
    "CYCLE": palette.CYCLE,
    "NOT_GOOD": {"bad": palette.NOT_GOOD, "diverged": palette.DIVERGED},
    "SHADES": {
        name: getattr(shades, name) for name in ("OUTER_SHARE", "OUTLIER_RATIO", "MIN_RANGE", "LOGARITHMIC_RATIO")
    },
    "PEAKS": {name: getattr(shades, name) for name in ("OUTSIDE", "CLIPPED")},
}
"""Constants that the page shares with figures: colours, and what ranges leave out"""
_PAGE = resources.files("orchestration.experiments.report") / "page"
_PLACE = re.compile(r"\{\{(\w+)\}\}")


def write(report: Report, out: Path) -> Path:
    """Write the file of a report; raises `WriteError`."""
    write_atomically(out, as_html(report))
    return out


def as_html(report: Report) -> str:
    """The text of the file."""
    parts = {
        "title": html.escape(report.title),
        "style": _text("style.css"),
        "data": _in_script(as_json(report)),
        "figures": json.dumps(FIGURES),
        "script": "\n".join(_text(name) for name in SCRIPTS),
    }
    return _PLACE.sub(lambda place: parts[place[1]], _text("page.html"))


def _in_script(document: str) -> str:
    """JSON escaped for a script element: names in it cannot open or close a tag."""
    return document.replace("<", "\\u003c").replace("\u2028", "\\u2028").replace("\u2029", "\\u2029")


def _text(name: str) -> str:
    return (_PAGE / name).read_text(encoding="utf-8")
