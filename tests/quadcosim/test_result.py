"""A result shows itself, and goes into tables and files of other programs."""

import sys
from pathlib import Path

import matplotlib.figure
import numpy as np
import pandas as pd
import pytest
from scipy.io import loadmat

import quadcosim
from orchestration.building import fmus
from quadcosim import QuadcosimError, Result, Scenario, System, UsageError
from tests.commands import Main


def test_a_result_says_in_a_line_what_became_of_it(flown: Result) -> None:
    assert repr(flown) == f"<Result: bounded, 0.2 s in {len(flown.rows)} rows of {len(flown.columns)} columns>"
    assert len(repr(flown)) < 100


def test_values_say_what_is_not_as_by_default() -> None:
    assert repr(Scenario()) == "Scenario()"
    assert repr(Scenario(timing=quadcosim.Timing(period=0.05))) == "Scenario(timing=Timing(period=0.05))"


def test_a_system_names_its_parts(flown: Result) -> None:
    assert isinstance(flown.system, System)
    assert repr(flown.system).startswith("<System of 0.2 s; components: plant, controller; connections: measurement,")
    assert len(repr(flown.system)) < 300


def test_an_fmu_tells_what_it_has_in_a_line() -> None:
    model = quadcosim.read_model(str(fmus.locate("native/QuadrotorPlant")))
    assert repr(model).startswith("<Model QuadrotorPlant, FMI 2: ")
    assert len(repr(model)) < 120
    assert model.variables["torque.x"].unit == "N.m"


def test_a_notebook_shows_metrics_by_names_for_people_with_units_and_the_outcome(flown: Result) -> None:
    shown = flown._repr_html_()
    for text in ("RMS position error", ">m<", "m·s", "bounded", "largest torque", "N·m", "0.2 s in"):
        assert text in shown
    assert "position_rmse" not in shown


def test_signals_become_a_table_over_time_with_units(flown: Result) -> None:
    table = flown.to_pandas()
    assert table.index.name == "time"
    assert list(table.columns) == list(flown.columns[1:])
    assert np.array_equal(table["plant.position.x"].to_numpy(), flown.signals["plant.position.x"])
    assert table.attrs["units"]["controller.torque.x"] == "N.m"


def test_events_become_a_table_in_seconds(flown: Result) -> None:
    table = flown.to_pandas("events")
    assert [tuple(row) for row in table.itertuples(index=False)] == [
        (event.time / 1e9, event.kind, event.what, event.sample) for event in flown.events
    ]


def test_without_pandas_one_line_names_the_extra(flown: Result, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(
        QuadcosimError, match=r"^pandas is not installed; this needs: pip install 'quadcosim\[studies\]'$"
    ):
        flown.to_pandas()


def test_figures_come_by_name_and_a_notebook_shows_them(flown: Result, tmp_path: Path) -> None:
    figures = flown.plot("errors", "path", beside=[flown])
    assert set(figures) == {"errors", "path"}
    assert isinstance(figures["errors"], matplotlib.figure.Figure)
    assert figures._repr_html_().count("data:image/png;base64,") == 2
    assert figures.save(tmp_path) == [tmp_path / name for name in ("path.png", "path.svg", "errors.png", "errors.svg")]


def test_a_figure_that_there_is_not_is_refused_with_those_there_are(flown: Result) -> None:
    with pytest.raises(UsageError, match="expected one of path, errors"):
        flown.plot("eror")


def test_csv_has_units_in_its_head_and_the_same_numbers(flown: Result, tmp_path: Path) -> None:
    signals, events = flown.to_csv(tmp_path)
    table = pd.read_csv(signals)
    assert {"time [s]", "plant.position.x [m]", "plant.torque.x [N.m]", "controller.attitude_error.w"} < set(table)
    assert table.to_numpy().tobytes() == flown.rows.tobytes()
    assert list(pd.read_csv(events)) == ["time [s]", "event", "what", "sample"]
    assert len(pd.read_csv(events)) == len(flown.events)


def test_mat_is_a_structure_of_columns_with_units_beside_them(flown: Result, tmp_path: Path) -> None:
    run = loadmat(flown.to_mat(tmp_path / "run.mat"), simplify_cells=True)["run"]
    assert np.array_equal(run["signals"]["plant"]["position"]["x"], flown.signals["plant.position.x"])
    assert np.array_equal(run["time"], flown.signals["time"])
    assert run["units"]["plant"]["torque"]["x"] == "N.m"
    assert (run["metrics"]["outcome"], run["metrics"]["steps"]) == ("bounded", flown.metrics["steps"])
    assert run["metric_units"]["position_rmse"] == "m"
    assert np.isnan(run["metrics"]["divergence_time"])
    assert [*run["events"]["event"][:2]] == [event.kind for event in flown.events[:2]]
    assert list(run["columns"]) == list(flown.columns[1:])


def test_the_command_exports_a_run_and_a_new_run_may_take_the_place_of_what_it_wrote(
    flown: Result, tmp_path: Path, main: Main
) -> None:
    folder = quadcosim.save_run(flown, tmp_path / "run", figures=False)
    done = main("export", folder, "--format", "csv", "--format", "mat")
    assert done.stdout.split() == [str(folder / name) for name in ("signals.csv", "events.csv", "run.mat")]
    assert all((folder / name).is_file() for name in ("signals.csv", "events.csv", "run.mat"))
    quadcosim.save_run(flown, folder, figures=False)
    assert not (folder / "run.mat").exists()


def test_the_command_says_which_formats_a_run_has(flown: Result, tmp_path: Path, main: Main) -> None:
    folder = quadcosim.save_run(flown, tmp_path / "run", figures=False)
    done = main("export", folder, "--format", "parquet", code=2)
    assert "--format parquet: expected csv or mat (signals.parquet and events.parquet are there already)" in done.stderr
