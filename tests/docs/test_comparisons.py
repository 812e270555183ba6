"""The maps of the findings are the results of their commands: one cell in a hundred of each is simulated again."""

import math
import random
import re
from pathlib import Path

import pytest

from docs import comparisons
from orchestration.comparison.run import rerun_cells

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
