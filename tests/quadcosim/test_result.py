"""A result shows itself, and goes into tables and files of other programs."""

import dataclasses
import sys
from pathlib import Path
from typing import Any

import matplotlib.figure
import numpy as np
import pandas as pd
import pytest
from scipy.io import loadmat

import quadcosim
from quadcosim import QuadcosimError, Result, Scenario, System, UsageError
from tests.commands import Main


def test_a_result_says_in_a_line_what_became_of_it(result: Result) -> None:
    assert repr(result) == f"<Result: bounded, 0.2 s in {len(result.rows)} rows of {len(result.columns)} columns>"
    assert len(repr(result)) < 100


def test_values_say_what_is_not_as_by_default() -> None:
    assert repr(Scenario()) == "Scenario()"
    assert repr(Scenario(timing=quadcosim.Timing(period=0.05))) == "Scenario(timing=Timing(period=0.05))"


def test_a_system_names_its_parts(result: Result) -> None:
    assert isinstance(result.system, System)
    assert repr(result.system).startswith("<System of 0.2 s; components: plant, controller; connections: measurement,")
    assert len(repr(result.system)) < 300


def test_an_fmu_tells_what_it_has_in_a_line() -> None:
    model = quadcosim.read_model("native/QuadrotorPlant")
    assert repr(model).startswith("<Model QuadrotorPlant, FMI 2: ")
    assert len(repr(model)) < 120
    assert model.variables["torque.x"].unit == "N.m"


def test_a_notebook_shows_metrics_by_names_for_people_with_units_and_the_outcome(result: Result) -> None:
    shown = result._repr_html_()
    for text in ("RMS position error", ">m<", "m·s", "bounded", "largest torque", "N·m", "0.2 s in"):
        assert text in shown
    assert "position_rmse" not in shown


def test_signals_become_a_table_over_time_with_units(result: Result) -> None:
    table = result.to_pandas()
    assert table.index.name == "time"
    assert list(table.columns) == list(result.columns[1:])
    assert np.array_equal(table["plant.position.x"].to_numpy(), result.signals["plant.position.x"])
    assert table.attrs["units"]["controller.torque.x"] == "N.m"


def test_events_become_a_table_in_seconds(result: Result) -> None:
    table = result.to_pandas("events")
    assert [tuple(row) for row in table.itertuples(index=False)] == [
        (event.time / 1e9, event.kind, event.what, event.sample) for event in result.events
    ]


def test_a_table_of_another_name_is_refused_with_those_that_there_are(result: Result) -> None:
    with pytest.raises(UsageError, match=r"what = 'event': did you mean events\? expected one of signals, events"):
        result.to_pandas("event")  # type: ignore[arg-type]


def test_without_pandas_one_line_names_the_extra(result: Result, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(
        QuadcosimError, match=r"^pandas is not installed; this needs: pip install 'quadcosim\[studies\]'$"
    ):
        result.to_pandas()


def test_figures_come_by_name_and_a_notebook_shows_them(result: Result, tmp_path: Path) -> None:
    figures = result.plot("errors", "path", beside=[result])
    assert set(figures) == {"errors", "path"}
    assert isinstance(figures["errors"], matplotlib.figure.Figure)
    assert figures._repr_html_().count("data:image/png;base64,") == 2
    assert figures.save(tmp_path) == [tmp_path / name for name in ("path.png", "path.svg", "errors.png", "errors.svg")]


def test_a_figure_that_there_is_not_is_refused_with_those_there_are(result: Result) -> None:
    with pytest.raises(UsageError, match="expected one of path, errors"):
        result.plot("eror")
    listed: Any = ["errors"]
    with pytest.raises(UsageError, match=r"^figure \['errors'\]: expected names, as in plot\('errors', 'path'\)$"):
        result.plot(listed)


@pytest.mark.parametrize("window", [(3.0, 1.0), (50.0, 60.0), "0-1", (0.0,), 3])
def test_a_window_without_a_row_is_refused_in_a_line(window: Any, result: Result) -> None:
    with pytest.raises(
        UsageError, match=r"^window = .*: expected 0 <= from < to, and from before the end at [\d.]+ s$"
    ):
        result.plot("errors", window=window)


@pytest.mark.parametrize("beside", [3, [3]])
def test_only_results_lie_beside_a_result(beside: Any, result: Result) -> None:
    with pytest.raises(UsageError, match=r"^beside = \[3\]: expected a list of results of runs$"):
        result.plot("errors", beside=beside)


def test_a_criterion_of_a_course_is_refused_before_anything_is_flown() -> None:
    system = Scenario().as_system()
    judged = dataclasses.replace(system.criterion, good="plant.position.x < 1")
    with pytest.raises(
        UsageError, match=r"^criterion.good: plant.position.x has a value at each instant; expected one"
    ):
        quadcosim.run(dataclasses.replace(system, criterion=judged, stop_time=0.01))


def test_what_keeps_no_run_is_neither_saved_nor_reported(tmp_path: Path) -> None:
    flights = quadcosim.Flights(arrays={}, given={}, recorded=(), shape=(), engine="batch", reason=None)
    with pytest.raises(UsageError, match=r"^save_run: <Flights: .*>: expected a Result of run"):
        quadcosim.save_run(flights, tmp_path / "run")  # type: ignore[arg-type]
    with pytest.raises(
        UsageError, match=r"^report: runs of fly: keep no run to be written: expected a Result of run, "
    ):
        quadcosim.report(flights, out=tmp_path / "report.html")


def test_csv_has_units_in_its_head_and_the_same_numbers(result: Result, tmp_path: Path) -> None:
    signals, events = result.to_csv(tmp_path)
    names = {"time [s]", "plant.position.x [m]", "plant.torque.x [N.m]", "controller.attitude_error.w"}
    assert names < set(pd.read_csv(signals))
    assert np.loadtxt(signals, delimiter=",", skiprows=1).tobytes() == result.rows.tobytes()
    assert list(pd.read_csv(events)) == ["time [s]", "event", "what", "sample"]
    assert len(pd.read_csv(events)) == len(result.events)


def test_mat_is_a_structure_of_columns_with_units_beside_them(result: Result, tmp_path: Path) -> None:
    run = loadmat(result.to_mat(tmp_path / "run.mat"), simplify_cells=True)["run"]
    assert np.array_equal(run["signals"]["plant"]["position"]["x"], result.signals["plant.position.x"])
    assert np.array_equal(run["time"], result.signals["time"])
    assert run["units"]["plant"]["torque"]["x"] == "N.m"
    assert (run["metrics"]["outcome"], run["metrics"]["steps"]) == ("bounded", result.metrics["steps"])
    assert run["metric_units"]["position_rmse"] == "m"
    assert np.isnan(run["metrics"]["divergence_time"])
    assert [*run["events"]["event"][:2]] == [event.kind for event in result.events[:2]]
    assert list(run["columns"]) == list(result.columns[1:])


def test_the_command_exports_a_run_and_a_new_run_may_take_the_place_of_what_it_wrote(
    result: Result, tmp_path: Path, main: Main
) -> None:
    folder = quadcosim.save_run(result, tmp_path / "run", figures=False)
    done = main("export", folder, "--format", "csv", "--format", "mat")
    assert done.stdout.split() == [str(folder / name) for name in ("signals.csv", "events.csv", "run.mat")]
    assert all((folder / name).is_file() for name in ("signals.csv", "events.csv", "run.mat"))
    quadcosim.save_run(result, folder, figures=False)
    assert not (folder / "run.mat").exists()


def test_the_command_says_which_formats_a_run_has(result: Result, tmp_path: Path, main: Main) -> None:
    folder = quadcosim.save_run(result, tmp_path / "run", figures=False)
    done = main("export", folder, "--format", "parquet", code=2)
    assert "--format parquet: expected csv or mat (signals.parquet and events.parquet are there already)" in done.stderr
