"""The rows of a study as a pandas DataFrame, an xarray Dataset, and files."""

import functools
import json
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pyarrow.parquet as pq
import pytest

import quadcosim
from orchestration.experiments.studies.axes import Axis
from orchestration.experiments.studies.store import Store, open_for_reading, open_for_writing
from orchestration.experiments.studies.study import Study
from orchestration.experiments.studies.study_file import load_study
from orchestration.experiments.studies.table import dataset, export, frame
from orchestration.simulation.workers.provenance import versions
from quadcosim import Scenario, UsageError
from tests.orchestration.experiments.studies.common import (
    GRID,
    METRICS,
    OBJECTIVES,
    Row,
    add,
    axis,
    files_in,
    row,
    starts,
    study,
    swept,
)

GRIDDED = {"timing.period": [0.02, 0.01], "timing.delay": [0.0, 0.01, 0.005]}


@pytest.fixture(scope="module")
def grid(tmp_path_factory: pytest.TempPathFactory) -> tuple[Study, Path]:
    """A study of two periods by three delays, run, and its store."""
    folder = tmp_path_factory.mktemp("grid")
    (folder / "study.toml").write_text(GRID.replace('"period"', '"timing.period"').replace('"delay"', '"timing.delay"'))
    chosen = load_study(folder / "study.toml")
    return chosen, swept(chosen, folder)


def stored(path: Path, rows: list[Row], grid: dict[str, list[Any]] | None) -> Path:
    """A store of rows that were never run."""
    with open_for_writing(path, OBJECTIVES) as store:
        about = {"axes": ["timing.period"], "grid": grid, "guids": {"plant": "{p}"}, "versions": {"numpy": "1"}}
        store.describe({name: json.dumps(value) for name, value in about.items()})
        add(store, rows)
    return path


# -- frames -----------------------------------------------------------------------------------------------


def test_a_frame_has_settings_metrics_seeds_guids_and_versions(grid: tuple[Study, Path]) -> None:
    _, path = grid
    table = frame(path)
    expected = {
        "design_index",
        "timing.period",
        "timing.delay",
        "key",
        "status",
        "message",
        "seed",
        "duration",
        "engine",
        "machine",
    }
    models = files_in(Scenario()).models_of(Scenario().as_system())
    guids, software = {name: model.description.guid for name, model in models.items()}, versions()
    origin = {f"guid.{side}" for side in guids} | {f"version.{name}" for name in software}
    assert set(table.columns) == expected | set(METRICS) | origin
    assert set(table["guid.plant"]) == {guids["plant"]}
    assert set(table["guid.controller"]) == {guids["controller"]}
    assert set(table["version.quadcosim"]) == {software["quadcosim"]}


def test_a_frame_is_sorted_by_design_index_with_the_settings_of_each_run(grid: tuple[Study, Path]) -> None:
    chosen, path = grid
    table = frame(path)
    assert table["design_index"].tolist() == list(range(6))
    assert table[["timing.period", "timing.delay"]].to_dict("records") == list(chosen.points)


def test_a_frame_has_the_metrics_of_direct_runs(grid: tuple[Study, Path]) -> None:
    chosen, path = grid
    table = frame(path)
    for index in (0, 4):
        direct = quadcosim.run(chosen.system(index, starts())).metrics
        for name in METRICS:
            value = table.loc[index, name]
            assert pd.isna(value) if direct[name] is None else value == direct[name], name


def test_integers_and_booleans_keep_their_types_in_a_frame(tmp_path: Path) -> None:
    rows = [row(0), row(1, metrics=None, message="no"), row(2, metrics={"diverged": True, "steps": 7})]
    table = frame(stored(tmp_path / "study.sqlite", rows, None))
    assert table["diverged"].tolist() == [False, pd.NA, True]
    assert table["steps"].tolist() == [3, pd.NA, 7]
    assert table["seed"].tolist() == [0, 1, 2]
    assert table["status"].tolist() == ["done", "failed", "done"]
    assert table["message"][1] == "no"


def test_an_axis_of_seeds_is_one_column(tmp_path: Path) -> None:
    table = frame(swept(study(axis("seed", 3, 1)), tmp_path))
    assert list(table.columns).count("seed") == 1
    assert table["seed"].tolist() == [3, 1]


# -- datasets ---------------------------------------------------------------------------------------------


def test_a_dataset_has_each_run_in_the_cell_of_its_settings(grid: tuple[Study, Path]) -> None:
    _, path = grid
    cube, table = dataset(path), frame(path)
    assert dict(cube.sizes) == {"timing.period": 2, "timing.delay": 3}
    assert {name: cube[name].to_numpy().tolist() for name in GRIDDED} == GRIDDED
    for _, run in table.iterrows():
        cell = cube.sel({"timing.period": run["timing.period"], "timing.delay": run["timing.delay"]})
        for name in ("outcome", "position_rmse", "control_effort.torque", "steps", "diverged"):
            assert cell[name].item() == run[name]
    assert len(set(cube["position_rmse"].to_numpy().ravel())) > 1


def test_a_cell_without_a_run_or_with_a_failed_one_is_empty(tmp_path: Path) -> None:
    rows = [row(0), row(1, metrics=None, message="no"), row(3)]
    path = stored(tmp_path / "study.sqlite", rows, {"timing.period": [0.0, 0.001, 0.002, 0.003]})
    found = dataset(path)["position_rmse"].to_numpy()
    assert np.isnan(found).tolist() == [False, True, True, False]


def test_an_axis_of_words_is_a_coordinate_too(tmp_path: Path) -> None:
    cube = dataset(swept(study(axis("timing.order", "jacobi", "gauss-seidel")), tmp_path))
    assert cube["timing.order"].to_numpy().tolist() == ["jacobi", "gauss-seidel"]


def test_sampled_axes_make_no_grid(tmp_path: Path) -> None:
    sampled = Axis(name="mass", targets=("plant.mass",), low=0.9, high=1.1)
    path = swept(study(sampled, method="random", samples=2), tmp_path)
    with pytest.raises(UsageError, match="expected a study whose axes all list their values"):
        dataset(path)
    assert frame(path)["mass"].between(0.9, 1.1).all()


# -- files ------------------------------------------------------------------------------------------------


def as_text(value: Any) -> str:
    """One text for every way to write a value: a number as the shortest decimal that reads back to the same bits."""
    if pd.isna(value):
        return ""
    if isinstance(value, (bool, np.bool_)):
        return str(value).lower()
    try:
        return repr(float(value))
    except ValueError:
        return str(value)


def test_exports_read_back_equal(grid: tuple[Study, Path], tmp_path: Path) -> None:
    _, path = grid
    table = frame(path)
    parquet, csv = export(path, tmp_path / "new")
    assert (parquet.name, csv.name) == ("runs.parquet", "runs.csv")
    pd.testing.assert_frame_equal(pd.read_parquet(parquet), table)
    read = pd.read_csv(csv, dtype=str, keep_default_na=False)
    assert list(read.columns) == list(table.columns)
    for name in table.columns:
        assert [as_text(value) for value in table[name]] == [as_text(value) for value in read[name]], name


def test_metrics_have_their_units_in_the_parquet_file_and_in_the_dataset(
    grid: tuple[Study, Path], tmp_path: Path
) -> None:
    _, path = grid
    parquet, _ = export(path, tmp_path)
    schema = pq.read_schema(parquet)
    for name, unit in {"position_iae": b"m.s", "horizon": b"s", "duration": b"s"}.items():
        assert schema.field(name).metadata == {b"unit": unit}
    assert schema.field("good").metadata is None
    assert dataset(path)["control_effort.torque"].attrs == {"units": "N2.m2.s"}


def test_exports_are_the_same_bytes_each_time(grid: tuple[Study, Path], tmp_path: Path) -> None:
    _, path = grid
    one, two = (export(path, tmp_path / name) for name in ("one", "two"))
    assert [file.read_bytes() for file in one] == [file.read_bytes() for file in two]


def test_a_failed_run_is_exported_with_its_message(tmp_path: Path) -> None:
    path = stored(tmp_path / "study.sqlite", [row(0), row(1, metrics=None, message='a, "b"')], None)
    _, csv = export(path, tmp_path)
    read = pd.read_csv(csv)
    assert read["message"][1] == 'a, "b"'
    assert read["status"].tolist() == ["done", "failed"]


def test_more_rows_than_one_block_are_counted_and_exported(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Store, "blocks", functools.partialmethod(Store.blocks, most=2000))
    number = 4500  # two blocks and a half of them
    measured = dict.fromkeys(METRICS, 0.1 + 0.2) | {"good": True, "diverged": False, "steps": 30000}
    rows = [row(i, metrics={**measured, "position_rmse": 0.001 * i}) for i in reversed(range(number))]
    path = stored(tmp_path / "study.sqlite", rows, {"timing.period": [0.001 * i for i in range(number)]})
    with open_for_reading(path) as store:
        assert store.counts() == {"done": number}
    parquet, csv = export(path, tmp_path)
    read = pd.read_parquet(parquet, columns=["design_index", "timing.period", "position_rmse"])
    assert read["design_index"].tolist() == list(range(number))
    assert read["position_rmse"].tolist() == [0.001 * i for i in range(number)]
    with csv.open() as lines:
        assert sum(1 for _ in lines) == number + 1


def test_a_grid_over_seeds_has_the_seed_as_an_axis(tmp_path: Path) -> None:
    path = swept(study(axis("seed", 0, 1), axis("timing.period", 0.01, 0.02)), tmp_path)
    assert dict(dataset(path).sizes) == {"seed": 2, "timing.period": 2}
