"""Flights of both real FMUs, against an independent simulation and against each other."""

import csv
import hashlib
import json
import signal
import subprocess
import sys
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from types import FrameType
from typing import Any

import numpy as np
import pytest

import quadcosim
from fmu_kit.trajectory import Trajectory
from orchestration.components.building import fmus
from orchestration.components.fmi.fmi2 import Fmi2Instance
from orchestration.quadrotor.scenarios.fmu_choice import FmuChoice, Record
from orchestration.quadrotor.scenarios.measures import desired
from orchestration.quadrotor.scenarios.translation import ReferenceChoice
from orchestration.quadrotor.scenarios.wiring import COMMAND, MEASUREMENT, POSITION_REFERENCE, REFERENCE
from orchestration.simulation.runs.prepared import prepared
from orchestration.systems.system.connection import component_of
from quadcosim import Result, RunInterrupted, Scenario, SimulatorError, Timing, UsageError
from tests.native import native
from tests.orchestration.quadrotor.scenarios.named_signals import scalars_beyond_exchanged

EVERYTHING: dict[str, Any] = {
    "delay": 0.003,
    "delay_jitter": 0.004,
    "jitter": 0.002,
    "measurement_loss": 0.05,
    "command_loss": 0.05,
    "burst_length": 2.0,
    "noise": {"position": 0.001, "angular_velocity": 0.01},
    "quantisation": {"velocity": 0.002},
}


def fly(stop_time: float, parameters: Mapping[str, float | str] | None = None, seed: int = 0, **timing: Any) -> Result:
    scenario = native(stop_time=stop_time, seed=seed, timing=Timing(**timing))
    return quadcosim.run(scenario.with_changes(parameters=parameters))


@cache
def long_flight(**timing: Any) -> Result:
    """A flight of 30 s, which more than one test looks at."""
    return fly(30.0, **timing)


@cache
def plain() -> Result:
    return fly(2.0)


def same_bits(one: Result, other: Result) -> bool:
    return one.columns == other.columns and one.rows.tobytes() == other.rows.tobytes() and one.events == other.events


def row_at(result: Result, time: float) -> int:
    (rows,) = np.flatnonzero(result.signals["time"] == time)
    return int(rows)


# -- against an independent simulation --------------------------------------------------------------------

CLOSED_LOOPS = [
    ("closed_loop_10ms.csv", {}),
    ("closed_loop_50ms.csv", {"period": 0.05}),
    ("closed_loop_20ms_delay_5ms.csv", {"period": 0.02, "delay": 0.005}),
]


def reference_rows(path: Path) -> list[dict[str, float]]:
    with path.open(newline="") as file:
        return [{name: float(value) for name, value in row.items()} for row in csv.DictReader(file)]


@pytest.mark.parametrize(("file", "timing"), CLOSED_LOOPS)
def test_every_state_is_that_of_an_independent_simulation(data: Path, file: str, timing: dict[str, float]) -> None:
    flight, expected = long_flight(**timing), reference_rows(data / file)
    assert len(expected) == 31
    for row in expected:
        at = row_at(flight, row["time"])
        for name in MEASUREMENT:
            assert flight.signals[f"plant.{name}"][at] == pytest.approx(row[name], rel=0.0, abs=1e-8)


@pytest.mark.parametrize(("file", "timing"), CLOSED_LOOPS)
def test_every_computed_command_is_that_of_an_independent_simulation(
    data: Path, file: str, timing: dict[str, float]
) -> None:
    flight = long_flight(**timing)
    rows = [row for row in reference_rows(data / file) if row["time"] < 30.0]  # at stop there is no sample
    assert len(rows) == 30
    for row in rows:
        for name in COMMAND:
            computed = flight.signals[f"controller.{name}"][row_at(flight, row["time"])]
            assert computed == pytest.approx(row[name], rel=1e-8, abs=1e-8)


# -- the same flight in other words -----------------------------------------------------------------------


@pytest.mark.parametrize("plant_interval", [0.001, 0.002, 0.005])
@pytest.mark.parametrize("timing", [{}, {"offset": 0.02, "delay": 0.015}, {"order": "jacobi"}], ids=str)
def test_the_fmus_clock_is_the_masters_to_the_bit(plant_interval: float, timing: dict[str, Any]) -> None:
    flights = [fly(2.0, clock=clock, plant_interval=plant_interval, **timing) for clock in ("fmu", "master")]
    assert same_bits(*flights)


def test_nothing_that_goes_wrong_by_zero_changes_a_bit() -> None:
    nothing = dict.fromkeys(("offset", "delay", "delay_jitter", "jitter", "measurement_loss", "command_loss"), 0.0)
    zero = {"position": 0.0, "quaternion.w": 0.0}
    others = {"noise": zero, "quantisation": zero, "jitter_distribution": "normal", "clock_ratio": 1.0}
    timing: dict[str, Any] = {**nothing, **others}
    assert same_bits(fly(2.0, seed=5, burst_length=3.0, **timing), plain())


def test_a_flight_is_the_same_after_another_in_this_process() -> None:
    fly(0.3, {"plant.mass": 2.0}, seed=3, **EVERYTHING)
    assert same_bits(fly(2.0), plain())


def test_the_scenario_of_no_arguments_is_the_paper_at_10_ms() -> None:
    scenario = Scenario()
    assert (scenario.stop_time, scenario.seed, scenario.timing) == (30.0, 0, Timing())
    assert (scenario.controller.fmu, scenario.plant.fmu) == ("UnifiedController", "QuadrotorPlant")


def test_the_paper_flight_settles() -> None:
    metrics = long_flight().metrics
    assert (metrics["outcome"], metrics["diverged"]) == ("settled", False)
    assert metrics["ultimate_bound"] < 0.05
    assert metrics["settling_time"] < 10.0
    assert metrics["steps"] == 30_000


HASH = """
import hashlib, json, sys
import quadcosim
from quadcosim import Scenario, Timing
from quadcosim import Timing
from tests.native import native
from tests.orchestration.quadrotor.scenarios.named_signals import scalars_beyond_exchanged
scenario = native(stop_time=1.0, seed=9, timing=Timing(**json.loads(sys.argv[1])))
result = quadcosim.run(scenario)
print(hashlib.sha256(result.rows.tobytes() + repr(result.events).encode()).hexdigest())
"""


def digest(result: Result) -> str:
    return hashlib.sha256(result.rows.tobytes() + repr(result.events).encode()).hexdigest()


def test_the_same_seed_gives_the_same_bits_in_another_process() -> None:
    here = digest(fly(1.0, seed=9, **EVERYTHING))
    there = subprocess.run(
        [sys.executable, "-c", HASH, json.dumps(EVERYTHING)], capture_output=True, text=True, check=True
    )
    assert there.stdout.split() == [here]


# -- the reference ----------------------------------------------------------------------------------------


def write_reference(path: Path, times: np.ndarray, trajectory: Trajectory) -> Path:
    with path.open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(("time", *REFERENCE))
        for t in times.tolist():
            d = trajectory.at(t)
            writer.writerow((t, *d.position, *d.velocity, *d.acceleration, *d.jerk, *d.snap))
    return path


def test_a_table_of_the_built_in_trajectory_gives_the_same_flight(tmp_path: Path) -> None:
    table = write_reference(tmp_path / "reference.csv", np.arange(0, 201) / 100, Trajectory())
    flight = quadcosim.run(native(stop_time=2.0, reference=ReferenceChoice(file=table)))
    for name in (*MEASUREMENT, *COMMAND):
        assert flight.signals[f"plant.{name}"] == pytest.approx(plain().signals[f"plant.{name}"], rel=1e-9, abs=1e-9)
    assert desired(flight.signals) == pytest.approx(desired(plain().signals), abs=1e-5)  # linear between rows
    assert flight.metrics["position_rmse"] == pytest.approx(plain().metrics["position_rmse"], abs=1e-5)


def test_the_true_error_is_that_to_the_trajectory_of_the_parameters() -> None:
    flight = fly(0.5, {"controller.trajectory.amplitude_x": 1.0, "controller.trajectory.start_z": 0.5})
    trajectory = Trajectory(amplitude_x=1.0, start_z=0.5)
    expected = np.array([[*trajectory.position(t)] for t in flight.signals["time"].tolist()])
    assert desired(flight.signals) == pytest.approx(expected, abs=1e-14)
    assert flight.signals["controller.position_error.z"][0] == pytest.approx(-0.5)


def test_a_table_that_is_too_short_is_refused(tmp_path: Path) -> None:
    table = write_reference(tmp_path / "short.csv", np.array([0.0, 1.0]), Trajectory())
    with pytest.raises(UsageError, match="expected 0 to stop_time = 2"):
        quadcosim.run(native(stop_time=2.0, reference=ReferenceChoice(file=table)))


# -- what its metrics rest on -----------------------------------------------------------------------------


def test_the_effort_of_a_flight_is_that_of_its_held_commands() -> None:
    flight = fly(0.5, period=0.05)
    held = np.diff(flight.signals["time"])
    for name, axes in (("thrust", ("thrust",)), ("torque", ("torque.x", "torque.y", "torque.z"))):
        squares = sum(flight.signals[f"plant.{axis}"][:-1] ** 2 for axis in axes)
        assert flight.metrics[f"control_effort.{name}"] == pytest.approx(float((squares * held).sum()), rel=1e-12)


def test_with_first_order_hold_the_effort_does_not_depend_on_the_rows() -> None:
    efforts = [fly(0.5, period=0.02, hold="first", plant_interval=step).metrics for step in (0.001, 0.00025)]
    for name in ("control_effort.torque", "total_variation.torque", "total_variation.thrust"):
        assert efforts[0][name] == pytest.approx(efforts[1][name], rel=0.005), name


def test_samples_whose_measurement_was_lost_do_not_count() -> None:
    flight = fly(1.0, period=0.02, measurement_loss=0.4, seed=1)
    lost = {event.time for event in flight.events if (event.kind, event.what) == ("lost", "measurement")}
    fresh = flight.sampled & ~np.isin(np.round(flight.signals["time"] * 1e9), list(lost))
    assert 0 < fresh.sum() < flight.sampled.sum()
    energy = flight.signals["controller.energy"][fresh]
    grown = (np.diff(energy) > 0.0) & (energy[1:] > 1e-3 * energy.max())
    assert flight.metrics["energy_growth_share"] == grown.mean() > 0.0


# -- divergence -------------------------------------------------------------------------------------------


def test_a_period_that_is_too_long_diverges_as_a_result() -> None:
    flight = fly(5.0, period=0.3)
    assert flight.metrics["diverged"] is True
    assert 0.0 < flight.metrics["divergence_time"] < 5.0
    assert flight.signals["time"][-1] < flight.metrics["divergence_time"]
    assert np.isfinite(flight.rows).all()
    assert str(flight.divergence).startswith("norm(plant.angular_velocity) = ")


def test_a_flight_that_diverged_has_no_metrics_but_what_became_of_it() -> None:
    found = fly(5.0, period=0.3).metrics
    assert {name for name, value in found.items() if value is not None} == {
        "outcome", "good", "horizon", "diverged", "divergence_time", "steps",
    }  # fmt: skip
    assert (found["outcome"], found["horizon"]) == ("diverged", 5.0)
    assert set(found) == set(plain().metrics)


def test_a_flight_that_has_not_come_close_by_its_horizon_is_bounded() -> None:
    assert (plain().metrics["outcome"], plain().metrics["horizon"]) == ("bounded", plain().system.stop_time)
    assert plain().provenance["wall_time"] > 0.0
    assert "wall_time" not in plain().metrics


def test_a_flight_that_does_not_diverge_reports_so() -> None:
    assert plain().divergence is None
    assert (plain().metrics["diverged"], plain().metrics["divergence_time"]) == (False, None)


# -- parameters and what is recorded ----------------------------------------------------------------------


def test_parameters_of_the_scenario_reach_the_fmus() -> None:
    heavy = fly(0.1, {"plant.mass": 2.0})
    pull, heavy_pull = (flight.signals["plant.acceleration.z"][0] - 9.81 for flight in (plain(), heavy))
    assert heavy_pull == pytest.approx(pull / 2.0, rel=1e-12)  # the same forces on twice the mass
    assert (heavy.rows[-1] != plain().rows[100]).any()
    weak = fly(0.1, {"controller.gain.attitude": 1.0})
    assert weak.signals["controller.torque.y"][0] != plain().signals["controller.torque.y"][0]


@pytest.mark.parametrize("timing", [{"offset": 0.004}, {"jitter": 0.009}, {"offset": 0.004, "clock_ratio": 1.25}])
def test_the_controller_is_stepped_to_its_first_sample_without_one(timing: dict[str, Any]) -> None:
    """FMI wants the first step to begin where initialisation was, and what is sampled stays what it is without it."""
    steps: list[tuple[float, float]] = []

    class Watched(Fmi2Instance):
        def step(self, t: float, h: float) -> None:
            if self.name == "controller":
                steps.append((t, h))
            super().step(t, h)

    asked = native(stop_time=0.1, timing=Timing(**timing))
    with prepared(asked, load=Watched) as simulation:
        simulation.master.initialise()
        simulation.master.run()
        result, count = simulation.result(), simulation.instances["controller"].get("sample_count")
    ends = [0.0, *(t + h for t, h in steps)]
    assert [t for t, _ in steps] == pytest.approx(ends[:-1], rel=1e-12)
    samples = [event.time for event in result.events if event.kind == "sampled"]
    assert samples[0] > 0
    assert len(steps) == len(samples) + 1
    assert count == len(samples)
    at_once = fly(0.1, delay=0.5)  # the command of initialisation, which is held until the first arrival
    assert result.signals["plant.thrust"][0] == at_once.signals["plant.thrust"][0]


def test_the_initial_state_is_that_of_the_scenario() -> None:
    flight = fly(0.05, {"plant.initial.position.x": 1.5, "plant.initial.velocity.z": -0.5})
    assert flight.signals["plant.position.x"][0] == 1.5
    assert flight.signals["plant.velocity.z"][0] == -0.5


def test_limits_of_the_plant_are_counted_as_saturation() -> None:
    assert fly(0.1, {"plant.torque_max": 1.0}).metrics["saturation_share"] > 0.5
    assert plain().metrics["saturation_share"] == 0.0


def test_what_is_recorded_can_be_chosen() -> None:
    record = Record(plant=("tilt",), controller=("energy",))
    flight = quadcosim.run(native(stop_time=0.05, record=record))
    exchanged = [f"plant.{name}" for name in (*COMMAND, *MEASUREMENT)]
    commands = [f"controller.{name}" for name in COMMAND]
    judged = [name for name in plain().columns if name in scalars_beyond_exchanged()]  # as the objectives name them
    of_plant, of_controller = (
        [chosen, *(name for name in judged if component_of(name) == component_of(chosen) and name != chosen)]
        for chosen in ("plant.tilt", "controller.energy")
    )
    assert "controller.attitude_error.w" in of_controller
    assert flight.columns == ("time", *exchanged, *of_plant, *commands, *of_controller, *POSITION_REFERENCE)
    chosen = [plain().columns.index(name) for name in flight.columns]
    assert flight.rows[:50].tolist() == plain().rows[:50, chosen].tolist()  # at its end it does not sample
    assert None not in (flight.metrics["attitude_error_rmse"], flight.metrics["energy_growth_share"])


def test_every_output_and_local_is_recorded_by_default() -> None:
    names = {"plant.tilt", "plant.wind.force.x", "controller.energy", "controller.attitude_error.w", "plant.thrust"}
    assert names <= set(plain().columns)


@pytest.mark.parametrize(
    ("parameters", "text"),
    [
        ({"plant.mas": 1.0}, "did you mean mass?"),
        ({"controller.gain.etta": 1.0}, "did you mean gain.eta "),
        ({"plant.qqqq": 1.0}, "its parameters are mass, gravity"),
        ({"plant.position.x": 1.0}, "expected a parameter"),
        ({"controller.position.x": 1.0}, "expected a parameter"),
        ({"plant.thrust": 1.0}, "expected a parameter"),
        ({"plant.mass": True}, "expected a number"),
        ({"plant.mass": "heavy"}, "expected a number"),
        ({"controller.use_reference_inputs": 1.0}, "expected true or false"),
        ({"controller.use_reference_inputs": True}, "expected [reference] name or file"),
    ],
)
def test_a_parameter_that_cannot_be_set_is_refused_in_one_line(parameters: dict[str, float | str], text: str) -> None:
    with pytest.raises(UsageError) as refused:
        fly(0.05, parameters)
    assert text in str(refused.value)
    assert str(refused.value).startswith(next(iter(parameters)))
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize("side", ["plant", "controller"])
def test_a_value_that_the_fmu_refuses_is_an_error_in_the_fmus_own_words(side: str) -> None:
    with pytest.raises(SimulatorError, match=r"mass = 0.0: expected a finite value > 0") as refused:
        quadcosim.run(Scenario(stop_time=0.05).with_changes(parameters={f"{side}.mass": 0.0}))
    assert str(refused.value).startswith(side)
    assert "Traceback" in refused.value.details


@pytest.mark.parametrize("side", ["plant", "controller"])
def test_a_value_below_what_the_fmu_declares_is_refused_before_it_is_loaded(side: str) -> None:
    with pytest.raises(UsageError, match=rf"^{side}.mass = -1.0: expected at least 0$"):
        fly(0.05, {f"{side}.mass": -1.0})


def test_a_record_of_what_is_no_variable_is_refused() -> None:
    with pytest.raises(UsageError, match="did you mean tilt"):
        quadcosim.run(native(stop_time=0.05, record=Record(plant=("tild",))))
    with pytest.raises(
        UsageError, match=r"^record.plant: mass is a parameter; expected an output, a local or an input$"
    ):
        quadcosim.run(native(stop_time=0.05, record=Record(plant=("mass",))))


def test_an_unknown_measurement_is_refused() -> None:
    with pytest.raises(UsageError, match=r"^timing.noise: positio is no signal of it; expected one of position"):
        fly(0.05, noise={"positio": 1.0})


def test_an_fmu_may_be_given_by_its_path() -> None:
    sides = {"plant": "native/QuadrotorPlant", "controller": "native/UnifiedController"}
    paths = {side: FmuChoice(fmu=str(fmus.locate(name))) for side, name in sides.items()}
    assert same_bits(quadcosim.run(native(stop_time=2.0, **paths)), plain())


def test_the_provenance_has_versions_and_guids(built: dict[str, Path]) -> None:
    provenance = plain().provenance
    assert set(provenance["versions"]) >= {"python", "quadcosim", "numpy", "fmpy", "pythonfmu"}
    assert provenance["versions"]["numpy"] == np.__version__
    assert provenance["versions"]["python"] == ".".join(map(str, sys.version_info[:3]))
    models = {side: fmu["model"] for side, fmu in provenance["fmus"].items()}
    assert models == {"plant": "QuadrotorPlant", "controller": "UnifiedController"}
    assert all(len(fmu["guid"]) == 36 for fmu in provenance["fmus"].values())
    assert json.loads(json.dumps(provenance)) == provenance


def test_events_are_in_order_of_time() -> None:
    times = [event.time for event in fly(0.5, order="jacobi", **EVERYTHING).events]
    assert times == sorted(times)


def test_the_fmus_have_nothing_to_warn_of() -> None:
    assert plain().warnings == ()
    assert fly(0.1, clock="fmu", offset=0.005, plant_interval=0.02).warnings == ()


def test_nominal_model_that_is_not_the_plant_is_warned_of_unless_it_is_meant() -> None:
    one_side = native(stop_time=0.02).with_changes(parameters={"plant.mass": 1.2, "controller.inertia.xy": 0.1})
    (warning,) = quadcosim.run(one_side).warnings
    assert "controller.mass = 1 where plant.mass = 1.2" in warning
    assert "controller.inertia.xy = 0.1 where plant.inertia.xy = 0," not in warning
    assert "controller.inertia.xy = 0.1 where plant.inertia.xy = 0." in warning
    assert "inertia.xx" not in warning
    assert quadcosim.run(one_side.with_changes(model_mismatch=True)).warnings == ()
    both = one_side.with_changes(parameters={"controller.mass": 1.2, "plant.inertia.xy": 0.1})
    assert quadcosim.run(both).warnings == ()


def test_axes_of_one_side_are_warned_of_however_they_are_set() -> None:
    one_side = native(stop_time=0.02).with_changes(parameters={"plant.frame_index": 2})
    (warning,) = quadcosim.run(one_side).warnings
    assert warning == "controller.frame is item 1, plant.frame item 2: expected the same axes on both sides"
    assert quadcosim.run(one_side.with_changes(parameters={"controller.frame": "enu"})).warnings == ()


# -- Ctrl-C -----------------------------------------------------------------------------------------------


def test_ctrl_c_is_not_blamed_on_an_fmu_that_is_python() -> None:
    """The signal comes while the slave computes, which would take it for an exception of its own."""
    steps = 0

    def hear(frame: FrameType, event: str, _: object) -> None:
        nonlocal steps
        if event == "call" and frame.f_code.co_name == "do_step":
            steps += 1
            if steps == 100:
                signal.raise_signal(signal.SIGINT)

    sys.setprofile(hear)
    try:
        with pytest.raises(RunInterrupted, match=r"^at t = 0\.\d+ s of 1 s$") as stop:
            quadcosim.run(Scenario(stop_time=1.0))
    finally:
        sys.setprofile(None)
    assert stop.value.result.interrupted_at == stop.value.result.rows[-1, 0]
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_ctrl_c_before_the_first_instant_ends_the_flight_there(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Fmi2Instance, "enter_initialization", lambda *_: signal.raise_signal(signal.SIGINT))
    with pytest.raises(KeyboardInterrupt):
        quadcosim.run(native(stop_time=1.0))


def test_an_error_after_ctrl_c_is_ctrl_c(monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: object) -> None:
        signal.raise_signal(signal.SIGINT)
        raise SimulatorError("plant: KeyboardInterrupt()")

    monkeypatch.setattr(Fmi2Instance, "step", fail)
    with pytest.raises(KeyboardInterrupt):
        quadcosim.run(native(stop_time=1.0), engine="python")


def test_the_second_ctrl_c_does_not_wait(monkeypatch: pytest.MonkeyPatch) -> None:
    def hang(*_: object) -> None:
        signal.raise_signal(signal.SIGINT)
        signal.raise_signal(signal.SIGINT)
        raise AssertionError("went on")

    monkeypatch.setattr(Fmi2Instance, "step", hang)
    with pytest.raises(KeyboardInterrupt):
        quadcosim.run(native(stop_time=1.0), engine="python")
