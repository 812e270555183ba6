"""Arrays in, arrays out: each run has the numbers and the rows that it has alone."""

import sys
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

import quadcosim
from orchestration.foundation.basics.errors import QuadcosimError
from orchestration.foundation.basics.statistics import wilson
from orchestration.quadrotor.scenarios.scenario import Scenario
from orchestration.quadrotor.scenarios.timing import Timing
from orchestration.simulation.engines.batch import shape
from orchestration.systems.system.component import Component
from orchestration.systems.system.files import located
from orchestration.systems.system.model import System
from tests.native import NATIVE
from tests.orchestration.components.fmi.small import needs_compiler, small

SHORT = NATIVE.with_changes(stop_time=0.5)
X, Y = "plant.initial.position.x", "plant.initial.position.y"
PLACES = {X: np.linspace(-1.0, 1.0, 11), Y: np.linspace(2.0, 3.0, 11)}
RECORDED = ("plant.position.x", "controller.thrust", "plant.torque.z", "reference.position.z")


def assert_as_alone(found: quadcosim.Flights, place: int, alone: quadcosim.Result) -> None:
    """Sums to 1e-12, signals to the byte, but for those of sources, whose mathematics is that of numpy."""
    for name, column in found.items():
        if name in alone.signals:
            rows, (count,) = column[place], alone.signals[name].shape
            assert np.isnan(rows[count:]).all()
            np.testing.assert_allclose(rows[:count], alone.signals[name], rtol=0.0, atol=1e-15 * ("refer" in name))
        else:
            value = alone.metrics[name]
            if name == "outcome":
                assert column[place] == value
                continue
            assert column[place] == pytest.approx(np.nan if value is None else float(value), rel=1e-12, nan_ok=True)


def assert_the_same_bits(one: quadcosim.Flights, other: quadcosim.Flights) -> None:
    """Of all arrays, which have the same order."""
    assert (one.engine, [*one]) == (other.engine, [*other])
    for name, column in one.items():
        assert (column.dtype, column.shape, column.tolist() if name == "outcome" else column.tobytes()) == (
            other[name].dtype, other[name].shape, other[name].tolist() if name == "outcome" else other[name].tobytes(),
        ), name  # fmt: skip


@needs_compiler
def test_each_run_of_arrays_is_the_run_alone() -> None:
    found = quadcosim.fly(SHORT, PLACES, record=RECORDED)
    assert_the_same_bits(found, quadcosim.fly(SHORT, PLACES, record=RECORDED, workers=2))
    assert (found.engine, found.reason, found.units["position_rmse"]) == ("batch", None, "m")
    assert {name for name, column in found.items() if column.dtype != np.float64} == {"outcome", "good", "diverged"}
    assert found["good"].dtype == found["diverged"].dtype == np.bool_
    assert found["position_rmse"].shape == (11,)
    assert found["plant.position.x"].shape == found["time"].shape == (11, 501)
    for place in (0, 10):
        own = {name: float(column[place]) for name, column in PLACES.items()}
        assert_as_alone(found, place, quadcosim.run(SHORT.with_changes(parameters=own)))


@needs_compiler
def test_a_local_that_no_run_records_unasked_can_be_recorded_of_the_runs_of_a_table() -> None:
    done: list[tuple[int, int]] = []
    table: Any = pd.DataFrame({X: [0.0, 1.0], "controller.discretisation": ["mean", "explicit"]})
    found = quadcosim.fly(
        SHORT, table, outputs=["good"], record=["controller.sample_count"], progress=lambda *of: done.append(of)
    )
    assert done == [(1, 2), (2, 2)]
    assert not found["good"].any()
    assert found.share("good") == pytest.approx((0.0, 0.0, 0.657620, 0.95), abs=1e-5)
    with pytest.raises(QuadcosimError, match=r"^share of time: expected an output that is true or false in each run"):
        found.share("time")
    assert found["controller.sample_count"][0, [0, -1]].tolist() == [1.0, 50.0]


@needs_compiler
def test_times_seeds_and_choices_are_arrays_too_and_shorter_runs_end_in_nan() -> None:
    values: dict[str, Any] = {
        "timing.period": [0.01, 0.02, 0.01, 0.03], "timing.jitter": 0.002, "seed": np.arange(4),
        "stop_time": [0.3, 0.2, 0.3, 0.1], X: [0.0, 1.0, 2.0, 3.0],
        "controller.discretisation": ["explicit", "midpoint", "mean", "explicit"],
    }  # fmt: skip
    found = quadcosim.fly(SHORT, values, outputs=["position_max", "horizon"], record=["plant.velocity.x"])
    assert list(found) == ["position_max", "horizon", "time", "plant.velocity.x"]
    assert found["horizon"].tolist() == [0.3, 0.2, 0.3, 0.1]
    for place in range(4):
        alone = SHORT.with_values({name: np.broadcast_to(each, 4)[place].item() for name, each in values.items()})
        assert_as_alone(found, place, quadcosim.run(alone))


@needs_compiler
def test_a_run_that_diverges_has_no_objectives_and_others_go_on() -> None:
    speed = "plant.initial.velocity.x"
    found = quadcosim.fly(SHORT, {X: [0.0, 90.0], speed: [0.0, 100.0]}, record=["plant.position.x"])
    assert found["position_max"][~found["diverged"]].shape == found["diverged"].nonzero()[0].shape == (1,)
    assert np.isnan(found["position_rmse"]).tolist() == [False, True]
    assert np.isfinite(found["divergence_time"]).tolist() == [False, True]
    assert_as_alone(found, 1, quadcosim.run(SHORT.with_changes(parameters={X: 90.0, speed: 100.0})))


@needs_compiler
def test_where_no_lanes_can_be_had_the_next_engine_flies_the_same_and_it_is_said_why(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    lanes = quadcosim.fly(SHORT, {X: [0.0, 1.0]}, record=RECORDED)

    def none() -> int:
        raise QuadcosimError("no compiler")

    monkeypatch.setattr(shape, "preferred_lanes", none)
    found = quadcosim.fly(SHORT, {X: [0.0, 1.0]}, record=RECORDED)
    assert_the_same_bits(found, quadcosim.fly(SHORT, {X: [0.0, 1.0]}, record=RECORDED, workers=2))
    assert (found.engine, found.reason) == ("compiled", "no compiler")
    assert list(found) == list(lanes)
    assert found["outcome"].tolist() == lanes["outcome"].tolist() == ["bounded", "bounded"]
    assert found.verdict == lanes.verdict == "2 bounded of 2 runs"
    for name in set(found) - {"outcome"}:
        np.testing.assert_allclose(found[name], lanes[name], rtol=1e-12, atol=1e-15)


@needs_compiler
def test_arrays_of_any_shape_broadcast_and_become_the_axes_of_a_dataset() -> None:
    across, down = np.array([-1.0, 0.0, 1.0]), np.array([[0.01], [0.02]])
    values: dict[str, Any] = {X: across, "timing.period": down, "seed": np.arange(6).reshape(2, 3), Y: 0.5}
    own = {"tilt_max": "max(plant.tilt)"}
    found = quadcosim.fly(
        SHORT, values, outputs=["outcome", "tilt_max", "steps"], record=["plant.position.x"], metrics=own
    )
    assert (found.shape, found["tilt_max"].shape, found["plant.position.x"].shape) == ((2, 3), (2, 3), (2, 3, 501))
    alone = SHORT.with_values({X: 1.0, Y: 0.5, "timing.period": 0.02, "seed": 5})
    flat = quadcosim.fly(alone, {}, outputs=["tilt_max"], record=["plant.position.x"], metrics=own)
    assert flat["tilt_max"].shape == ()
    assert flat["tilt_max"] == found["tilt_max"][1, 2]
    assert flat["plant.position.x"].tobytes() == found["plant.position.x"][1, 2].tobytes()

    dataset = found.to_xarray()
    assert dataset.sizes == {"timing.period": 2, X: 3, "time": 501}
    assert dataset["tilt_max"].sel({X: 1.0, "timing.period": 0.02}) == found["tilt_max"][1, 2]
    assert (dataset["tilt_max"].units, dataset["time"].units, dataset["outcome"].dtype.kind) == ("rad", "s", "U")
    table = found.to_pandas()
    assert [*table] == [*values, "outcome", "tilt_max", "steps"]
    assert table["timing.period"].tolist() == [0.01] * 3 + [0.02] * 3
    assert table["tilt_max"].tolist() == found["tilt_max"].reshape(-1).tolist()
    units = {"timing.period": "s", X: "m", Y: "m", "tilt_max": "rad"}
    assert {name: table.attrs["units"].get(name) for name in (*units, "seed")} == {**units, "seed": None}
    assert {name: dataset[name].attrs["units"] for name in units} == units
    shown = found._repr_html_()
    assert found.verdict in shown
    assert "<th>tilt_max</th>" in shown


@needs_compiler
def test_the_index_of_a_table_and_the_dimensions_of_arrays_are_kept() -> None:
    import xarray as xr

    brief: Any = NATIVE.with_changes(stop_time=0.01)
    table = pd.DataFrame({X: [0.0, 1.0, 2.0], Y: 0.5})
    chosen = table[table[X] > 0.0]
    flown = quadcosim.fly(brief, chosen, outputs=["steps"])
    assert table.join(flown.to_pandas()["steps"])["steps"].isna().tolist() == [True, False, False]
    assert flown.to_xarray()["steps"].sel({X: 2.0}).size == 1
    assert quadcosim.fly(brief, {X: chosen[X], Y: np.zeros((2, 1))}, outputs=["steps"]).axes == {}

    place, width = xr.DataArray([0.0, 1.0], {"side": ["left", "right"]}, "side"), xr.DataArray(np.arange(3.0), dims="w")
    found = quadcosim.fly(brief, {X: place, Y: width, "seed": width * 0 + place * 0 + 1}, outputs=["steps"])
    assert (found.shape, found.given["seed"].shape) == ((2, 3), (2, 3))
    assert found.to_xarray()["steps"].sel(side="left").sizes == {"w": 3}


def test_a_dimension_of_the_values_has_not_the_name_of_that_of_the_rows() -> None:
    import xarray as xr

    values = {X: xr.DataArray([0.0, 1.0], dims="time")}
    assert quadcosim.fly(SHORT, values, outputs=["good"]).to_xarray()["good"].sizes == {"time": 2}
    with pytest.raises(QuadcosimError, match=r"^values: a dimension is called time, as that of what is recorded"):
        quadcosim.fly(SHORT, values, record=["plant.position.x"])


def test_labels_that_contradict_each_other_are_refused() -> None:
    import xarray as xr

    named = xr.DataArray([0.0, 1.0], {"side": ["left", "right"]}, "side")
    one, other = pd.Series([0.0, 1.0]), pd.Series([0.0, 1.0], [1, 0])
    cases: list[tuple[dict[str, Any], str]] = [
        ({X: one, Y: other}, rf"^values of {Y}: index has other labels than bef"),
        ({X: named, Y: named[::-1]}, rf"^values of {Y}: side has other labels than before; expected the same for all"),
        ({X: named, Y: xr.DataArray([0.0] * 3, dims="side")}, rf"^values of {Y}: side: 3 values; expected 2 as bef"),
        ({X: named, Y: named.rename(side="w"), "seed": [0, 1]}, "^values of seed: an array; expected one of xarray "),
    ]
    for values, message in cases:
        with pytest.raises(QuadcosimError, match=message):
            quadcosim.fly(SHORT, values)


@needs_compiler
def test_runs_share_their_times_as_far_as_they_go_or_have_their_own() -> None:
    settings: Any = {"outputs": ["steps"], "record": ["plant.position"]}
    shorter = quadcosim.fly(SHORT, {"stop_time": [0.1, 0.2, 0.1]}, **settings).to_xarray()
    assert shorter["plant.position.x"].dims == ("stop_time", "time")
    assert shorter["plant.position.x"].count("time").values.tolist() == [101, 201, 101]
    coarser = quadcosim.fly(SHORT, {"timing.plant_interval": [0.001, 0.002]}, **settings).to_xarray()
    assert coarser["plant.position.x"].dims == coarser["time"].dims == ("timing.plant_interval", "row")


def test_a_share_is_of_all_runs_of_a_part_of_the_axes_or_of_those_chosen() -> None:
    good = np.array([[True, False, True], [True, True, True]])
    flights = quadcosim.Flights(arrays={"good": good}, given={}, recorded=(), shape=(2, 3), engine="batch", reason=None)
    across = flights.share(axis=1, where=[True, False, True], confidence=0.99)
    assert np.shape(across.low) == (2,)
    assert (np.asarray(across.value).tolist(), np.asarray(across.low)[1]) == ([1.0, 1.0], wilson(2, 2, 0.99)[0])
    assert flights.share(axis=["axis_0", 1]) == flights.share()
    assert np.shape(flights.share(axis="axis_0").low) == (3,)
    wrong: list[tuple[dict[str, Any], str]] = [
        ({"axis": 2}, "axis 2 is out of"), ({"where": [1, 2, 3]}, "no truth"), ({"where": [True] * 4}, "broadcast"),
        ({"where": False}, "^share of good: where chooses no run; expected one"),
        ({"axis": 1, "where": [[True], [False]]}, "chooses no run at 1 of 2 places"),
        ({"axis": "y"}, "^axis = y: expected one of axis_0, axis_1$"), ({"confidence": 99}, "between 0 and 1"),
    ]  # fmt: skip
    for arguments, message in wrong:
        with pytest.raises(QuadcosimError, match=message):
            flights.share(**arguments)


@pytest.mark.parametrize("package", ["pandas", "xarray"])
def test_without_its_package_a_table_is_refused_in_a_line(package: str, monkeypatch: pytest.MonkeyPatch) -> None:
    found = quadcosim.Flights(arrays={}, given={}, recorded=(), shape=(0,), engine="batch", reason=None)
    monkeypatch.setitem(sys.modules, package, None)
    with pytest.raises(QuadcosimError, match=rf"^{package} is not installed; this needs: pip install 'quadcosim\[stu"):
        getattr(found, f"to_{package}")()


@needs_compiler
def test_foreign_fmus_are_flown_alone_and_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    system = System(stop_time=0.1, components={"one": Component(fmu=str(small(tmp_path)), step=0.01)})
    found = quadcosim.fly(system, {"stop_time": [0.1, 0.2]})
    assert found["horizon"].tolist() == [0.1, 0.2]
    assert found.engine == "compiled"
    assert "components.one: not built here" in str(found.reason)
    assert capsys.readouterr().err.startswith(
        f"warning: 2 runs one by one, each in a process of its own: {found.reason}"
    )
    assert "components.one: small.fmu" in str(quadcosim.fly(system, {"stop_time": [0.1]}, in_process=True).reason)


WRONG: list[tuple[Any, dict[str, Any], str]] = [
    ({"plant.initial.position.w": [0.0]}, {}, r"plant.initial.position.w: QuadrotorPlant has no such variable"),
    ({"plan.mass": [1.0]}, {}, r"plan.mass: expected controller.NAME, plant.NAME"),
    ({"timing.perod": [0.1]}, {}, r"timing.perod: expected .*timing.KEY with KEY one of period"),
    (
        {X: [0.0, 1.0], Y: [0.0] * 3},
        {},
        rf"^values of {Y}: shape \(3,\); expected one that broadcasts with \(2,\), that of",
    ),
    ({X: [0.0, float("nan")]}, {}, rf"^values of {X}: nan in run 1; expected finite numbers$"),
    ({X: ["far"]}, {}, rf"^values of {X}: .far. is no number; expected numbers$"),
    (
        {X: [[0.0], [1.0, 2.0]]},
        {},
        rf"^values of {X}: expected an array of numbers, truth values or words, with one at",
    ),
    (
        {X: np.ma.masked_array([0.0, 1.0], [False, True])},
        {},
        rf"^values of {X}: some are masked; expected a value for each run$",
    ),
    ({X: []}, {}, rf"^values of {X}: expected an array of numbers"),
    ([1, 2], {}, r"^values = \[1, 2\]: expected a dictionary of values by path, as \{'seed': 1\}$"),
    ({3: [1.0]}, {}, r"^values = \{3: \[1.0\]\}: expected paths as text, not 3$"),
    ({X: [0.0]}, {"metrics": 3}, r"^metrics = 3: expected a dictionary of expressions by name$"),
    ({X: [0.0]}, {"record": 3}, r"^record = 3: expected a list of names$"),
    ({"seed": [0, -1]}, {}, r"^seed = -1: expected a whole number from 0 to 2\^63 - 1$"),
    ({"seed": [0.5]}, {}, r"^seed = 0.5: expected a whole number"),
    (
        {X: [0.0]},
        {"metrics": {"steps": "max(plant.tilt)"}},
        r"^metrics: steps: expected another name; this one is taken",
    ),
    ({X: [0.0]}, {"metrics": {"tilt": np.max}}, r"^metrics: tilt = .*: expected an expression as text"),
    ({X: [0.0]}, {"metrics": {"tilt": "max(plant.tlt)"}}, r"plant.tlt"),
    ({X: [0.0]}, {"metrics": {"tilt": "plant.tilt"}}, r"tilt: plant.tilt has a value at each instant; .* as max\(…\)"),
    ({"plant.mass": [1.0, -1.0]}, {}, r"^plant.mass = -1.0: expected at least 0"),
    ({"timing.period": [0.1, -1.0]}, {}, r"^run 1: timing.period = -1.0: expected a positive number$"),
    ({"controller.discretisation": ["mean", "meen"]}, {}, r"controller.discretisation = meen: did you mean mean"),
    ({"controller.fmu": ["A", "B"]}, {}, r"controller.fmu: expected runs of the same FMUs"),
    ({X: [0.0], f"components.{X.replace('t.', 't.parameters.', 1)}": [1.0]}, {}, r"are given twice"),
    (
        {X: [0.0]},
        {"outputs": ["position_rms"]},
        r"^outputs: position_rms: did you mean position_rmse\? expected one of",
    ),
    ({X: [0.0]}, {"record": ["plant.positionx"]}, r"record.plant: QuadrotorPlant has no variable positionx"),
    ({X: [0.0]}, {"record": ["plant.positon"]}, r"record.plant: QuadrotorPlant has no variable positon"),
    ({X: [0.0]}, {"record": ["wing.x"]}, r"^record: wing.x: expected COMPONENT.VARIABLE of plant, controller"),
    ({X: [0.0, 0.0], "plant.initial.quaternion.w": [1.0, 0.0]}, {}, r"^run 1: "),
    ({X: [[0.0], [0.0]], "plant.initial.quaternion.w": [1.0, 0.0]}, {}, r"^run \(0, 1\): "),
    (
        {X: [[0.0], [0.0]], "plant.initial.quaternion.w": [1.0, 0.0]},
        {"workers": 2},
        r"^run \(., 1\): .*expected a quaternion that is not zero$",
    ),
    ({X: [0.0]}, {"workers": 0}, r"^workers = 0: expected at least 1, a whole number$"),
]


@pytest.mark.parametrize(("values", "more", "message"), WRONG, ids=[message for *_, message in WRONG])
def test_what_cannot_be_is_refused_in_a_line(values: dict[str, Any], more: dict[str, Any], message: str) -> None:
    still = {f"plant.initial.quaternion.{axis}": 0.0 for axis in "xyz"}
    with pytest.raises(QuadcosimError, match=message) as error:
        quadcosim.fly(SHORT, values | still if "quaternion" in str(values) else values, **more)
    assert "\n" not in str(error.value)


@needs_compiler
def test_runs_whose_controller_believes_another_plant_are_warned_of_once(capsys: pytest.CaptureFixture[str]) -> None:
    brief, masses = NATIVE.with_changes(stop_time=0.02), {"plant.mass": [1.0, 1.1, 1.2]}
    quadcosim.fly(brief, masses)
    warned = capsys.readouterr().err
    assert warned.startswith(
        "warning: the controller's nominal model is not the plant: controller.mass = 1 where plant"
    )
    assert warned.count("plant.mass = 1.1") == warned.count("\n") == 1
    quadcosim.fly(brief, {**masses, "controller.mass": masses["plant.mass"]})
    quadcosim.fly(brief.with_changes(model_mismatch=True), masses)
    assert capsys.readouterr().err == ""
    quadcosim.fly(brief, {"timing.period": [0.01, 30.0, 40.0]})
    assert capsys.readouterr().err == (
        "warning: timing.period = 40.0: the run ends at 0.02 s, so controller samples only once "
        "(times are in seconds: 40 ms is 0.04)\n"
    )


def test_runs_share_what_they_do_not_have_of_their_own() -> None:
    from orchestration.simulation.runs.columns import columns

    system = located(Scenario(timing=Timing(period=0.01)).as_system())
    models = {name: quadcosim.read_model(component.fmu) for name, component in system.components.items()}
    runs = columns(Scenario(), system, models, {X: np.zeros(100), "timing.period": [0.01, 0.02] * 50})
    assert len({id(one) for one in runs.systems}) == 2
