"""The maps of the findings are the results of their commands: one cell in a hundred of each is simulated again."""

import math
import random
import re
from pathlib import Path

import pytest

from docs import comparisons
from orchestration.experiments.comparison.run import rerun_cells

PAGES = sorted((Path(comparisons.__file__).parent / "findings").glob("*.md"))
FLOWN = sorted(path.stem for path in comparisons.DATA.glob("*.json"))


def test_every_comparison_of_the_pages_is_kept_and_said_how_to_fly() -> None:
    assert sorted(comparisons.NAMES) == FLOWN
    text = "\n".join(page.read_text(encoding="utf-8") for page in PAGES)
    assert {*re.findall(r"quadcosim compare studies/comparisons/(\w+)\.toml", text)} >= {*FLOWN}


def test_every_picture_of_a_comparison_is_drawn_from_what_is_kept() -> None:
    shown = {path.stem for path in (Path(comparisons.__file__).parent / "figures").glob("comparison_*.png")}
    assert {name for name, _ in comparisons.figures()} == shown


@pytest.mark.parametrize("name", FLOWN)
def test_every_cell_of_a_map_is_one_of_its_file(name: str) -> None:
    expected = [
        (cell.index, cell.vehicle, cell.condition, cell.controller, cell.value)
        for cell in comparisons.load(name).cells()
    ]
    kept = comparisons.read_data(name)["cells"]
    keys = ("cell", "vehicle", "condition", "controller", "value")
    assert [tuple(cell[key] for key in keys) for cell in kept] == expected


COUNTS = {
    ("redesign", "mismatches", (0.02, 0.07, 0.1, 0.15)): {
        "as in the model": "nominal", "half the inertia": "half the inertia", "twice the inertia": "twice the inertia",
        "a lag of 30 ms": "lag of 30 ms", "half the mass": "half the mass", "twice the mass": "twice the mass",
        "wind of 0.5 N": "wind of 0.5 N",
    },
    ("redesign", "losses", (0.2, 0.3, 0.4, 0.5)): {
        "unified, κ = 1": "unified", "unified, κ = 0": "unified, no coupling", "geometric": "geometric",
        "unified, κ = 1, `mean` over 20 ms": "unified, mean", "cascade at one rate": "cascade, one rate",
    },
    ("tuned_gains", "tuned", (0.01, 0.02, 0.05, 0.1, 0.15, 0.2)): {
        "unified, paper's gains": "unified, paper's gains", "unified, tuned for 10 ms": "unified, tuned for 10 ms",
        "geometric, tuned for 10 ms": "geometric, tuned for 10 ms",
        "cascade at one rate, tuned for 10 ms": "cascade, one rate, tuned for 10 ms",
        "unified, tuned for the period": "unified, tuned for its period",
        "geometric, tuned for the period": "geometric, tuned for its period",
        "cascade at one rate, tuned for the period": "cascade, one rate, tuned for its period",
    },
    ("real_vehicle", "vehicles", (0.005, 0.02, 0.06, 0.1)): {
        "paper": "paper", "Crazyflie": "crazyflie", "Crazyflie without lag": "crazyflie without lag",
        "Hummingbird": "hummingbird", "Agilicious": "agilicious",
    },
}  # fmt: skip
"""Tables of a page with counts of a comparison at some values: the first cell of a row, and what it is in the map"""


@pytest.mark.parametrize(("page", "name", "values"), COUNTS)
def test_counts_of_the_pages_are_those_of_the_maps(page: str, name: str, values: tuple[float, ...]) -> None:
    """How many survive, and in brackets how many settle where these are fewer."""
    text = (Path(comparisons.__file__).parent / "findings" / f"{page}.md").read_text(encoding="utf-8")
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


@pytest.mark.parametrize("name", FLOWN)
def test_one_cell_in_a_hundred_is_what_is_flown_again(name: str) -> None:
    """The runs of `quadcosim compare studies/comparisons/NAME.toml --cell K`, here in lanes."""
    kept = comparisons.read_data(name)["cells"]
    chosen = sorted(random.Random(name).sample(kept, math.ceil(len(kept) / 100)), key=lambda cell: cell["cell"])
    simulated = rerun_cells(comparisons.load(name), [cell["cell"] for cell in chosen], engine="batch")
    steady = rerun_cells(comparisons.on_path(comparisons.load(name)), [cell["cell"] for cell in chosen], engine="batch")
    for cell, summary, alone in zip(chosen, simulated, steady, strict=True):
        row = summary.row("value")
        for key in ("count", "survives", "settles", "diverged", "diverged_late"):
            assert row[key] == cell[key], key
        for key in comparisons.REPORTED:
            again = [math.nan if row[f"{key}{end}"] is None else row[f"{key}{end}"] for end in ("", ".low", ".high")]
            before = [math.nan if one is None else one for one in cell[key]]
            assert again == pytest.approx(before, rel=1e-4, nan_ok=True), key
        residual = alone.medians["residual"].value
        assert residual == (None if cell["on_path"] is None else pytest.approx(cell["on_path"], rel=1e-4))
