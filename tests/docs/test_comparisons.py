"""The maps of the findings are what their commands fly: one cell in a hundred of each is flown again."""

import math
import random
import re
from collections.abc import Iterator, Sequence
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import pytest

from docs import comparisons
from orchestration.building.inputs import all_with_files
from orchestration.comparison.cells import CellSummary, frame_of, results
from orchestration.comparison.design import Comparison
from orchestration.workers.task import Chunk, Runner, RunTask

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
        for cell in comparisons.loaded(name).cells()
    ]
    kept = comparisons.kept(name)["cells"]
    keys = ("cell", "vehicle", "condition", "controller", "value")
    assert [tuple(cell[key] for key in keys) for cell in kept] == expected


@pytest.fixture(scope="module")
def runner() -> Iterator[Runner]:
    """Flies all maps in this process, as a worker does."""
    with closing(Runner()) as runner:
        yield runner


def flown_again(runner: Runner, comparisons: Sequence[Comparison], indices: Sequence[int]) -> list[list[CellSummary]]:
    """What `quadcosim compare studies/comparisons/NAME.toml --cell K` flies of each, all of it in lanes at once."""
    comparisons = [replace(one, native=True) for one in comparisons]
    runs = [[i for index in indices for i in one.runs_of(one.cell(index))] for one in comparisons]
    systems = []
    for one, some in zip(comparisons, runs, strict=True):
        study, files = one.study, one.study.files()
        starts = files.starts_of(study.origin)
        systems += all_with_files([study.system(i, starts) for i in some], {**files.fmus, **files.tables})
    tasks = [
        RunTask(index=i, key="", settings={}, system=system, keep_signals=False) for i, system in enumerate(systems)
    ]
    flown = iter(runner.fly_chunk(Chunk(tasks=tuple(tasks))))
    return [
        results(one, frame_of(one, [(i, dict(next(flown).row.metrics or {})) for i in some]))
        for one, some in zip(comparisons, runs, strict=True)
    ]


@pytest.mark.parametrize("name", FLOWN)
def test_one_cell_in_a_hundred_is_what_is_flown_again(name: str, runner: Runner) -> None:
    kept = comparisons.kept(name)["cells"]
    chosen = sorted(random.Random(name).sample(kept, math.ceil(len(kept) / 100)), key=lambda cell: cell["cell"])
    comparison = comparisons.loaded(name)
    flown, steady = flown_again(
        runner, [comparison, comparisons.on_path(comparison)], [cell["cell"] for cell in chosen]
    )
    for cell, summary, alone in zip(chosen, flown, steady, strict=True):
        row = summary.row("value")
        for key in ("count", "survives", "settles", "diverged", "diverged_late"):
            assert row[key] == cell[key], key
        for key in comparisons.TOLD:
            again = [math.nan if row[f"{key}{end}"] is None else row[f"{key}{end}"] for end in ("", ".low", ".high")]
            before = [math.nan if one is None else one for one in cell[key]]
            assert again == pytest.approx(before, rel=1e-4, nan_ok=True), key
        residual = alone.medians["residual"].value
        assert residual == (None if cell["on_path"] is None else pytest.approx(cell["on_path"], rel=1e-4))
