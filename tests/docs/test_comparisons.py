"""The maps of the findings are the results of their commands: one cell in a hundred of each is simulated again."""

import math
import random
import re
from collections.abc import Mapping
from itertools import islice
from pathlib import Path

import pytest

from docs import comparisons
from orchestration.experiments.comparison.run import rerun_cells
from tests.extent import WHOLE, tries

DOCS = Path(comparisons.__file__).parent
PAGES = (DOCS / "redesigns.md", *sorted((DOCS / "findings").glob("*.md")))
FLOWN = sorted(comparisons.NAMES)


def test_every_comparison_of_the_pages_is_kept_and_said_how_to_fly() -> None:
    assert all((comparisons.DATA / f"{name}.json").is_file() for name in FLOWN)
    text = " ".join(word for page in PAGES for word in page.read_text(encoding="utf-8").split())
    assert {*re.findall(r"(?:quadcosim compare studies/comparisons/|`)(\w+)\.toml", text)} >= {*FLOWN}


def test_every_picture_of_a_comparison_is_drawn_from_what_is_kept() -> None:
    shown = {path.stem for path in (Path(comparisons.__file__).parent / "figures").glob("comparison_*.png")}
    drawn = {name for name, _ in islice(comparisons.figures(), None if WHOLE else 1)}
    assert drawn == shown if WHOLE else len(drawn & shown) == 1


@pytest.mark.parametrize("name", FLOWN)
def test_every_cell_of_a_map_is_one_of_its_file(name: str) -> None:
    expected = [
        (cell.index, cell.vehicle, cell.condition, cell.controller, cell.value)
        for cell in comparisons.load(name).cells()
    ]
    kept = comparisons.read_data(name)["cells"]
    keys = ("cell", "vehicle", "condition", "controller", "value")
    assert [tuple(cell[key] for key in keys) for cell in kept] == expected


COUNTS: Mapping[tuple[str, str, tuple[float, ...]], Mapping[str, str]] = {
    ("redesigns", "mismatches", (0.02, 0.07, 0.1, 0.15)): {
        "as in the model": "nominal", "half the inertia": "half the inertia", "twice the inertia": "twice the inertia",
        "a lag of 30 ms": "lag of 30 ms",
    },
    ("findings/vehicles", "vehicles", (0.005, 0.02, 0.06, 0.1)): {
        "paper": "paper", "Crazyflie": "crazyflie", "Crazyflie without lag": "crazyflie without lag",
        "Hummingbird": "hummingbird", "Agilicious": "agilicious",
    },
    ("findings/terms", "separation", (1.8, 3.75, 7.5, 15.0)): {
        "κ = 1": "unified", "κ/k_q held": "unified, coupling scaled", "κ = 0": "unified, no coupling",
    },
}  # fmt: skip
"""Tables of a page with counts of a comparison at some values: the first cell of a row, and what it is in the map"""


@pytest.mark.parametrize(("page", "name", "values"), COUNTS)
def test_counts_of_the_pages_are_those_of_the_maps(page: str, name: str, values: tuple[float, ...]) -> None:
    """How many survive, and in brackets how many settle where these are fewer."""
    text = (DOCS / f"{page}.md").read_text(encoding="utf-8")
    table = text[text.index(f"studies/comparisons/{name}.toml") :]
    told, flown = {}, {}
    for row, where in COUNTS[page, name, values].items():
        cells = re.findall(rf"^\| {re.escape(row)} \| (.*)$", table, re.M)[0]
        counts = re.findall(r"(?<![\d.])(\d+)(?: \((\d+)\))?(?=,| \|)", cells)
        told[row] = [(int(alive), int(settle or alive)) for alive, settle in counts]
        flown[row] = [
            (cell["survives"], cell["settles"])
            for cell in comparisons.read_data(name)["cells"]
            if where in (cell["vehicle"], cell["condition"], cell["controller"]) and cell["value"] in values
        ]
    assert told == flown


SETTLING = {
    "unified": ("tuned", "unified, tuned for its period"),
    "unified without coupling": ("tuned_alike", "no coupling, tuned for its period"),
    "geometric": ("tuned", "geometric, tuned for its period"),
    "cascade at one rate": ("tuned", "cascade, one rate, tuned for its period"),
    "unified, `mean`": ("tuned_mean", "unified, mean, tuned for its period"),
    "unified, for settling time": ("tuned_settling", "unified, tuned for settling"),
    "geometric, for settling time": ("tuned_settling", "geometric, tuned for settling"),
}
"""Rows of the table of settling times: the map and the controller in it"""


def settling_rows() -> dict[str, str]:
    """The rows of the table, from the maps."""
    rows = {}
    for row, (name, controller) in SETTLING.items():
        cells = {
            cell["value"]: cell for cell in comparisons.read_data(name)["cells"] if cell["controller"] == controller
        }
        medians = [
            "{:.2f} ({:.2f} to {:.2f})".format(*cells[value]["settling_time"]) if value in cells else ""
            for value in (0.05, 0.1, 0.15, 0.2)
        ]
        rows[row] = " | ".join(medians)
    return rows


def test_settling_times_of_the_page_are_those_of_the_maps() -> None:
    text = (DOCS / "findings" / "cascade.md").read_text(encoding="utf-8")
    for row, medians in settling_rows().items():
        assert f"| {row} | {medians} |" in text


@pytest.mark.parametrize("name", FLOWN if WHOLE else ["positions"])
def test_one_cell_in_a_hundred_is_what_is_flown_again(name: str) -> None:
    """The runs of `quadcosim compare studies/comparisons/NAME.toml --cell K`, here in lanes."""
    kept = comparisons.read_data(name)["cells"]
    chosen = sorted(
        random.Random(name).sample(kept, tries(math.ceil(len(kept) / 100), sampled=1)), key=lambda cell: cell["cell"]
    )
    simulated = rerun_cells(comparisons.load(name), [cell["cell"] for cell in chosen], engine="batch")
    steady = rerun_cells(comparisons.on_path(comparisons.load(name)), [cell["cell"] for cell in chosen], engine="batch")
    for cell, summary, alone in zip(chosen, simulated, steady, strict=True):
        row = summary.row()
        for key in ("count", "survives", "settles", "diverged", "diverged_late"):
            assert row[key] == cell[key], key
        for key in comparisons.REPORTED:
            again = [math.nan if row[f"{key}{end}"] is None else row[f"{key}{end}"] for end in ("", ".low", ".high")]
            before = [math.nan if one is None else one for one in cell[key]]
            assert again == pytest.approx(before, rel=1e-4, nan_ok=True), key
        residual = alone.medians["residual"].value
        assert residual == (None if cell["on_path"] is None else pytest.approx(cell["on_path"], rel=1e-4))
