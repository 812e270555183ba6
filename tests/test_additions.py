"""What is added has all its parts, as `docs/architecture.md` lists them under Where to add."""

import re

import pytest
import typer.main

from orchestration.command.cli import app
from orchestration.simulation.engines.batch.folds import LANES
from orchestration.simulation.figures.views import VIEWS
from orchestration.systems.expressions.operators import OPERATORS
from orchestration.systems.expressions.reductions import REDUCTIONS
from tests.places import ROOT

PAGES = {path: path.read_text(encoding="utf-8") for path in (ROOT / "README.md", *(ROOT / "docs").rglob("*.md"))}
TESTS = "".join(path.read_text(encoding="utf-8") for path in (ROOT / "tests").rglob("test_*.py"))
COMMANDS = sorted(typer.main.get_command(app).commands)  # type: ignore[attr-defined]
FIGURES = sorted({name for view in VIEWS.values() for name in view.names})


def words(*cells: str) -> set[str]:
    """The names in cells of a table, without their arguments."""
    return set(" ".join(re.sub(r"\(.*?\)", "", text) for cell in cells for text in re.findall("`(.*?)`", cell)).split())


def test_every_reduction_has_its_form_in_lanes() -> None:
    assert set(REDUCTIONS) == set(LANES)


def test_the_page_of_systems_has_every_function_of_the_language() -> None:
    row = re.search(
        r"^\| at one instant \| over a run \|\n\|.*\n\|(.*)\|(.*)\|$", PAGES[ROOT / "docs/systems.md"], re.M
    )
    assert row is not None
    assert words(row[1]) == {name for name, made in OPERATORS.items() if made.tree is None}
    assert words(row[2]) == {*REDUCTIONS}


def test_the_page_of_figures_has_every_figure_of_a_run() -> None:
    of_runs = PAGES[ROOT / "docs/figures.md"].partition("## Of a run")[2].partition("\n## ")[0]
    assert words(*re.findall(r"^\| (`.*?`) \|", of_runs, re.M)) - {"--figure"} == {*FIGURES}


@pytest.mark.parametrize("kind", VIEWS)
def test_every_figure_has_its_maker(kind: str) -> None:
    assert {*VIEWS[kind].load().makers} == {*VIEWS[kind].names}


@pytest.mark.parametrize("name", COMMANDS)
def test_a_page_and_a_test_have_every_command(name: str) -> None:
    assert any(re.search(rf"\bquadcosim {name}\b", text) for text in PAGES.values())
    assert f'"{name}"' in TESTS


@pytest.mark.parametrize("name", FIGURES)
def test_a_test_has_every_figure(name: str) -> None:
    assert f'"{name}"' in TESTS
