"""The notebooks run from top to bottom, and are kept without what they print."""

import os
from pathlib import Path

import nbformat
import pytest
from nbclient import NotebookClient

from tests.patience import PATIENCE

FOLDER = Path(__file__).parents[2] / "docs" / "notebooks"
NOTEBOOKS = sorted(FOLDER.glob("*.ipynb"))


def test_there_are_a_flight_a_limit_a_controller_of_ones_own_and_arrays() -> None:
    assert [path.stem for path in NOTEBOOKS] == ["arrays", "flight", "limit", "own_controller"]


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_runs_from_top_to_bottom_and_shows_its_results(path: Path, tmp_path: Path) -> None:
    notebook = nbformat.read(path, as_version=4)
    client = NotebookClient(
        notebook,
        timeout=round(PATIENCE),
        startup_timeout=round(PATIENCE),
        kernel_name="python3",
        resources={"metadata": {"path": tmp_path}},
    )
    client.execute(env={**os.environ, "PATH": os.defpath})  # no environment is activated
    shown = [output for cell in notebook.cells for output in cell.get("outputs", ())]
    kinds = {kind for output in shown for kind in output.get("data", ())}
    assert "text/html" in kinds
    assert any("image/png" in str(output) for output in shown)


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_is_kept_without_outputs(path: Path) -> None:
    notebook = nbformat.read(path, as_version=4)
    nbformat.validate(notebook)
    for cell in notebook.cells:
        assert cell.get("outputs", []) == []
        assert cell.get("execution_count") is None
