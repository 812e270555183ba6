"""References and disturbances of a flight: by name, by file, by flag, in every engine."""

import dataclasses
import math
from pathlib import Path

import numpy as np
import pytest

import quadcosim
from orchestration.quadrotor.flight.hover import hover_of
from orchestration.quadrotor.scenarios.translation import DRAG, choice_of, paths_of
from orchestration.simulation.runs.result import Result
from orchestration.systems.signals.dryden import DRAWS, Dryden
from orchestration.systems.signals.library import make_signal
from orchestration.systems.signals.waypoints import read_waypoints
from orchestration.systems.system.file import system_from_tables
from orchestration.systems.system.file_tables import tables_of
from orchestration.systems.system.paths import changed
from quadcosim import DisturbanceChoice, ReferenceChoice, Scenario, UsageError, load_scenario
from tests.commands import Main
from tests.orchestration.components.fmi.small import needs_compiler
from tests.orchestration.simulation.engines.batch.lanes import assert_the_same_signals, in_lanes, located, shape_of
from tests.orchestration.simulation.engines.batch.test_signals import plain

POINTS = "x,y,z,hold,speed\n0,0,0,0.2,0\n1,0,-1,0,2\n1,1,-1,0.3,2\n"
WIND = "time,wind.x,wind.y,wind.z\n0,0,0,0\n0.5,4,0,0\n1.0,0,-2,1\n2,0,0,0\n"
FORCE = "time,external_force.x,external_force.y,external_force.z\n0,0,0,0\n0.5,1,0,0\n1.0,0,-2,1\n2,0,0,0\n"


@pytest.fixture
def points(tmp_path: Path) -> Path:
    return written(tmp_path / "points.csv", POINTS)


def written(path: Path, text: str) -> Path:
    path.write_text(text)
    return path


def simulated(**fields: object) -> Result:
    scenario = dataclasses.replace(Scenario(stop_time=0.6, seed=3), **fields)  # type: ignore[arg-type]
    return quadcosim.run(located(scenario.as_system()))


# -- what is simulated --------------------------------------------------------------------------------------------


def test_the_controller_is_fed_the_motion_at_its_samples_and_its_error_is_recorded() -> None:
    flight = simulated(reference=ReferenceChoice(name="lemniscate", parameters={"radius": 1.5}), stop_time=1.0)
    motion = make_signal("lemniscate", {"radius": 1.5})
    for i in (0, 10, 990):
        expected = motion.at(flight.signals["time"][i])
        assert [flight.signals[f"reference.position.{axis}"][i] for axis in "xyz"] == [*expected.position]
        assert [flight.signals[f"reference.snap.{axis}"][i] for axis in "xyz"] == [*expected.snap]
    late = flight.signals["time"][990]
    error = flight.signals["plant.position.x"][990] - motion.at(late).position.x
    assert flight.signals["controller.position_error.x"][990] == pytest.approx(error, abs=1e-12)


def test_a_flight_passes_its_way_points(points: Path) -> None:
    flight, curve = simulated(reference=ReferenceChoice(file=points)), read_waypoints(points, {})
    found = [flight.signals[f"reference.position.{axis}"][500] for axis in "xyz"]
    assert found == curve.at(np.array([0.5]))[0, 0].tolist()


def test_a_wind_from_a_file_pushes_by_the_drag_and_a_force_as_it_is(tmp_path: Path) -> None:
    wind, force = written(tmp_path / "wind.csv", WIND), written(tmp_path / "force.csv", FORCE)
    blown = simulated(disturbance=DisturbanceChoice(file=wind, drag=0.25))
    pushed = simulated(disturbance=DisturbanceChoice(file=force))
    assert blown.signals["disturbance.external_force.x"][500] == 1.0
    assert blown.signals["disturbance.external_force.x"][250] == pytest.approx(0.5)
    assert pushed.signals["disturbance.external_force.x"][500] == 1.0
    assert (
        simulated(disturbance=DisturbanceChoice(file=wind)).signals["disturbance.external_force.x"][500] == 4.0 * DRAG
    )


def test_a_force_acts_on_the_vehicle_over_the_interval_that_begins_with_it(tmp_path: Path) -> None:
    text = "time,external_force.x,external_force.y,external_force.z\n0,0,0,0\n0.3,2,0,0\n9,2,0,0\n"
    with_, without = (
        simulated(disturbance=choice)
        for choice in (
            DisturbanceChoice(file=written(tmp_path / "f.csv", text), interpolation="previous"),
            DisturbanceChoice(),
        )
    )
    moved = with_.signals["plant.velocity.x"] - without.signals["plant.velocity.x"]
    assert not moved[:301].any()
    assert moved[301] == pytest.approx(2.0 * 0.001, rel=1e-6)  # F/m over a plant interval of 1 ms
    assert [*with_.signals["disturbance.external_force.x"][298:302]] == [0.0, 0.0, 2.0, 2.0]


def test_gusts_are_those_of_the_seed_at_their_steps() -> None:
    choice = DisturbanceChoice(name="dryden", drag=0.5, parameters={"wind_speed": 8.0, "step": 0.02})
    one, same, other = (simulated(disturbance=choice, seed=seed) for seed in (3, 3, 4))
    name = "disturbance.external_force.y"
    assert one.rows.tobytes() == same.rows.tobytes()
    assert not (one.signals[name] == other.signals[name]).any()
    from orchestration.systems.schedule.streams import VALUE, Streams

    stream = Streams(3).of("sources.disturbance", VALUE)
    wind = Dryden(wind_speed=8.0, step=0.02).velocities(stream.standard_normal((30, DRAWS)).tolist())
    assert one.signals[name][::20][:30] == pytest.approx(0.5 * np.array(wind)[:, 1], rel=1e-12)


@needs_compiler
@pytest.mark.parametrize("name", ["lemniscate", "points"])
def test_engines_have_the_same_rows_to_the_byte(name: str, points: Path) -> None:
    reference = ReferenceChoice(file=points) if name == "points" else ReferenceChoice(name=name)
    gusts = DisturbanceChoice(name="dryden", parameters={"wind_speed": 6.0})
    scenario = Scenario(stop_time=0.25, seed=5, reference=reference, disturbance=gusts)
    system = plain(located(scenario.as_system()))
    python, compiled = quadcosim.run(system, engine="python"), quadcosim.run(system, engine="compiled")
    assert python.rows.tobytes() == compiled.rows.tobytes()
    shape, others = shape_of(system), [system, changed(system, {"seed": 6})]
    found = in_lanes(shape, others)
    for lane, what in enumerate(others):
        assert_the_same_signals(shape, found, lane, quadcosim.run(what, engine="compiled"))


def test_about_hover_there_is_neither_reference_nor_disturbance() -> None:
    windy = Scenario(reference=ReferenceChoice(name="circle"), disturbance=DisturbanceChoice(name="dryden"))
    assert hover_of(windy) == hover_of(Scenario())


# -- how it is written -------------------------------------------------------------------------------------------


def test_a_scenario_file_round_trips(tmp_path: Path, points: Path) -> None:
    text = f"""
    [reference]
    file = "{points.name}"
    speed = 2

    [disturbance]
    name = "dryden"
    drag = 0.3
    wind_speed = 7.5
    """
    scenario = load_scenario(written(tmp_path / "s.toml", text))
    assert scenario.reference == ReferenceChoice(file=points, parameters={"speed": 2.0})
    assert scenario.disturbance == DisturbanceChoice(name="dryden", drag=0.3, parameters={"wind_speed": 7.5})
    again = load_scenario(written(tmp_path / "again.toml", scenario.to_toml()))
    assert again == scenario


def test_the_system_of_a_scenario_comes_back_from_its_file(points: Path) -> None:
    for reference in (ReferenceChoice(name="step", parameters={"dx": 2.0}), ReferenceChoice(file=points)):
        system = Scenario(reference=reference, disturbance=DisturbanceChoice(name="dryden", drag=0.2)).as_system()
        assert system_from_tables(tables_of(system), Path()) == system


def test_axes_and_flags_reach_the_parameters(main: Main) -> None:
    system = Scenario(
        reference=ReferenceChoice(name="circle"), disturbance=DisturbanceChoice(name="dryden")
    ).as_system()
    for target, value in (("reference.radius", 3.0), ("disturbance.wind_speed", 9.0), ("disturbance.drag", 0.7)):
        (path,) = paths_of(target)
        assert quadcosim.changed(system, {path: value}) != system
    changed_ = Scenario(reference=ReferenceChoice(name="circle")).with_changes(parameters={"reference.radius": 3.0})
    assert changed_.reference.parameters == {"radius": 3.0}
    assert choice_of("way.CSV") == {"file": Path("way.CSV")}
    flags = ("--reference", "circle", "--set", "reference.radius=0", "--disturbance", "dryden")
    assert "reference.radius = 0.0: expected a positive number" in main("run", *flags, code=2).stderr


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ('[reference]\nname = "circel"', "reference.name = circel: did you mean circle? expected one of hover, "),
        ('[reference]\nname = "circle"\nradios = 1', "reference.radios: circle has no such parameter; did you mean"),
        ('[reference]\nname = "circle"\nradius = "big"', "reference.radius = big: expected a finite number"),
        ('[reference]\nname = "circle"\nradius = nan', "reference.radius = nan: expected a finite number"),
        ('[reference]\nname = "circle"\nfile = "a.csv"', "reference.name = circle: expected none beside a file"),
        ('[reference]\nname = "dryden"', "reference.name = dryden: expected one of hover, step, circle"),
        ('[reference]\nfile = "a.csv"\nradius = 1', "reference.radius: way-points has no such parameter; expected"),
        ("[reference]\nradius = 1", "reference.radius: no such key; expected one of name, file"),
        ('[disturbance]\nname = "circle"', "disturbance.name = circle: expected one of dryden"),
        ('[disturbance]\nname = "dryden"\nheight = 1', "disturbance.height = 1.0: expected 3.048 to 304.8 m"),
        ('[disturbance]\nname = "dryden"\ndrag = -1', "disturbance.drag = -1.0: expected zero or a positive number"),
        ('[disturbance]\nname = "dryden"\ninterpolation = "previous"', "disturbance.interpolation = previous: expe"),
        ('[disturbance]\nfile = "a.csv"\ninterpolation = "cubic"', "disturbance.interpolation = cubic: expected one"),
        ("[disturbance]\nname = 3", "disturbance.name = 3: expected a text"),
    ],
)
def test_what_cannot_be_is_refused_in_one_line_that_names_its_place(tmp_path: Path, text: str, line: str) -> None:
    path = written(tmp_path / "s.toml", text)
    with pytest.raises(UsageError) as error:
        load_scenario(path)
    assert str(error.value).startswith(f"{path}: {line}")


def test_constructors_refuse_what_files_do() -> None:
    with pytest.raises(UsageError, match=r"reference\.radius = 0: expected|reference\.radius = 0.0: expected"):
        ReferenceChoice(name="circle", parameters={"radius": 0})
    with pytest.raises(UsageError, match=r"disturbance\.drag = inf: expected zero or a positive number"):
        DisturbanceChoice(name="dryden", drag=math.inf)
    with pytest.raises(UsageError, match=r"reference\.radius: expected reference\.name or reference\.file as well"):
        ReferenceChoice(parameters={"radius": 2.0})


def test_a_drag_beside_forces_is_refused(tmp_path: Path) -> None:
    force = written(tmp_path / "force.csv", FORCE)
    with pytest.raises(UsageError, match=r"disturbance\.drag: expected columns wind\.x, wind\.y, wind\.z in"):
        Scenario(disturbance=DisturbanceChoice(file=force, drag=1.0)).as_system()


@needs_compiler
def test_payloads_are_let_go_at_their_times_in_every_lane() -> None:
    base = plain(located(Scenario(stop_time=0.12).as_system()))
    loads = [(0.0, 0.0), (0.4, 0.0503), (0.2, 0.0997), (0.3, 0.0)]
    path = "components.plant.parameters.payload"
    systems = [changed(base, {f"{path}.mass": mass, f"{path}.drop_time": time}) for mass, time in loads]
    shape = shape_of(base)
    found = in_lanes(shape, systems)
    for lane, what in enumerate(systems):
        assert_the_same_signals(shape, found, lane, quadcosim.run(what, engine="compiled"))
