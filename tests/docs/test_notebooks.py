"""The notebooks run from top to bottom, and are kept without what they print."""

import os
from pathlib import Path
from typing import Any

import pytest

from tests.extent import WHOLE
from tests.patience import PATIENCE
from tests.places import ROOT

FOLDER = ROOT / "docs" / "notebooks"
NOTEBOOKS = sorted(FOLDER.glob("*.ipynb"))
RUN = NOTEBOOKS if WHOLE else [FOLDER / "flight.ipynb"]


def test_there_are_a_flight_a_limit_a_controller_of_ones_own_and_arrays() -> None:
    assert [path.stem for path in NOTEBOOKS] == ["arrays", "flight", "limit", "own_controller"]


@pytest.fixture(scope="module")
def executed(tmp_path_factory: pytest.TempPathFactory) -> dict[Path, list[Any]]:
    """The cells of each notebook with their outputs, run in one kernel: starting one takes as long as a notebook.

    Each begins in an empty folder and with none of the names of the one before.
    """
    import nbformat
    from nbclient import NotebookClient

    cells = {path: nbformat.read(path, as_version=4).cells for path in RUN}
    all_cells = []
    for path, own in cells.items():
        folder = tmp_path_factory.mktemp(path.stem)
        for cell in own:
            cell["id"] = f"{path.stem}-{cell['id']}"
        all_cells += [nbformat.v4.new_code_cell(f"%reset -f\n%cd -q {folder}"), *own]
    notebook = nbformat.v4.new_notebook(cells=all_cells)
    client = NotebookClient(notebook, timeout=round(PATIENCE), startup_timeout=round(PATIENCE), kernel_name="python3")
    client.execute(env={**os.environ, "PATH": os.defpath})  # no environment is activated
    return cells


@pytest.mark.parametrize("path", RUN, ids=lambda path: path.stem)
def test_a_notebook_runs_from_top_to_bottom_and_shows_its_results(path: Path, executed: dict[Path, list[Any]]) -> None:
    shown = [output for cell in executed[path] for output in cell.get("outputs", ())]
    kinds = {kind for output in shown for kind in output.get("data", ())}
    assert "text/html" in kinds
    assert any("image/png" in str(output) for output in shown)


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_is_kept_without_outputs(path: Path) -> None:
    import nbformat

    notebook = nbformat.read(path, as_version=4)
    nbformat.validate(notebook)
    for cell in notebook.cells:
        assert cell.get("outputs", []) == []
        assert cell.get("execution_count") is None
