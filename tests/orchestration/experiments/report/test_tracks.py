"""Thinned signals keep what a reader looks for: peaks, and what is held between rows."""

import dataclasses
from typing import Any

import numpy as np
import pytest

from orchestration.experiments.report.blobs import Blobs
from orchestration.experiments.report.model import ReportTrack
from orchestration.experiments.report.tracks import Signals, Tracks, layout_of
from orchestration.foundation.basics.simulator import Floats
from orchestration.quadrotor.flight.layout import POSITION_ERROR, FlightLayout
from orchestration.quadrotor.scenarios.translation import quadrotor
from orchestration.quadrotor.scenarios.wiring import POSITION_REFERENCE
from orchestration.simulation.figures.palette import MAX_LINES, MAX_PANELS
from orchestration.simulation.results.units import ColumnInfo
from orchestration.systems.system.paths import changed
from tests.orchestration.experiments.report.test_blobs import read

ABOUT = {"tank.level": ColumnInfo(unit="m", text="of the water")}


def flight(count: int = 5001) -> dict[str, Floats]:
    """A quadrotor that stands still but for a short peak of its thrust."""
    time = np.linspace(0.0, 10.0, count)
    found = {"time": time, **{name: np.zeros(count) for name in (*FlightLayout.compact, *POSITION_REFERENCE)}}
    found["plant.quaternion.w"] = np.ones(count)
    found["plant.position.x"] = np.sin(time)
    found["plant.thrust"] = np.where((time > 3.0) & (time < 3.02), 50.0, 9.81)
    return found


def columns_of(tracks: Tracks, blobs: Blobs, track: ReportTrack) -> dict[str, Floats]:
    names = tracks.layouts[track.layout].columns
    found = {name: read(blobs.blobs[place]) for name, place in zip(names, track.columns, strict=True)}
    return {"time": read(blobs.blobs[track.time]), **found}


def whole(signals: Signals, rows: int) -> dict[str, Floats]:
    blobs = Blobs()
    tracks = Tracks(blobs)
    return columns_of(tracks, blobs, tracks.whole(quadrotor(), signals, {}, rows))


def compact(signals: Signals, points: int) -> dict[str, Floats]:
    blobs = Blobs()
    tracks = Tracks(blobs)
    return columns_of(tracks, blobs, tracks.compact(quadrotor(), signals, {}, points))


def test_rows_that_are_left_out_are_none_of_those_at_an_extreme() -> None:
    found = whole(flight(), rows=50)
    assert len(found["time"]) < 80
    assert found["plant.thrust"].max() == 50.0
    assert found["time"][[0, -1]].tolist() == [0.0, 10.0]


def test_a_short_run_is_there_whole() -> None:
    signals = flight(40)
    np.testing.assert_allclose(whole(signals, rows=50)["plant.position.x"], signals["plant.position.x"], rtol=1e-7)


def test_points_are_dense_where_most_happens_and_a_held_value_is_never_in_between() -> None:
    found = compact(flight(), points=100)
    near = (found["time"] > 2.99) & (found["time"] < 3.03)
    assert near.sum() > 10
    assert set(np.round(found["plant.thrust"], 2)) == {9.81, 50.0}
    np.testing.assert_allclose(found["plant.position.x"], np.sin(found["time"]), atol=1e-3)


def test_the_position_error_of_a_flight_is_computed_to_small_values() -> None:
    found = compact(flight(), points=100)
    np.testing.assert_allclose(found[POSITION_ERROR], np.abs(np.sin(found["time"])), rtol=2e-2, atol=1e-3)


def test_any_other_system_has_panels_by_unit_named_after_their_quantities_and_no_scene() -> None:
    blobs = Blobs()
    tracks = Tracks(blobs)
    tracks.whole(None, {"time": np.arange(3.0), "tank.level": np.arange(3.0), "tank.valve": np.ones(3)}, ABOUT, 10)
    (layout,) = tracks.layouts
    assert layout.scene is None
    assert [(panel.title, panel.unit) for panel in layout.panels] == [("tank: level", "m"), ("tank: valve", None)]


def test_a_page_of_many_signals_opens_with_the_first_of_their_panels() -> None:
    panels = layout_of(None, [f"it.x{i}" for i in range(MAX_LINES * MAX_PANELS + 1)], {}).panels
    assert [panel.shown for panel in panels] == [True] * MAX_PANELS + [False]


def test_runs_that_are_alike_share_a_layout() -> None:
    tracks = Tracks(Blobs())
    assert [tracks.whole(quadrotor(), flight(20), {}, 10).layout for _ in range(2)] == [0, 0]
    assert len(tracks.layouts) == 1


@pytest.mark.parametrize("given", [{"frame": "enu"}, {"frame_index": 2}])
def test_a_flight_in_east_north_up_is_replayed_and_shown_as_any_other(given: dict[str, Any]) -> None:
    turned = changed(quadrotor(), {f"components.plant.parameters.{name}": value for name, value in given.items()})
    columns = [*flight(), POSITION_ERROR]
    known, other = (layout_of(system, columns, {}) for system in (quadrotor(), turned))
    assert known.scene is not None
    assert other.scene == dataclasses.replace(known.scene, is_enu=True)
    assert other.panels == known.panels
