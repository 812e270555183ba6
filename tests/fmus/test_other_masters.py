"""What other masters do: the flight is the same, whatever number, order and form of calls a tool prefers."""

import json
import math
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from fmpy.fmi1 import FMICallException
from fmpy.fmi2 import fmi2False

from tests.extent import in_test_all, sample, tries
from tests.fmus.expected import COMMAND, MEASUREMENT, law_command
from tests.fmus.flights import STEPS, Flight
from tests.fmus.instance import Instance
from tests.fmus.loop import Loop
from tests.fmus.making import PAIR, Making
from tests.fmus.process import run_script

PLANT, CONTROLLER = "QuadrotorPlant", "UnifiedController"
Rows = list[list[str]]


@pytest.fixture
def plain(name: str, alone: dict[str, Rows]) -> Rows:
    """The flight with no call too many."""
    return alone[name]


@pytest.fixture
def instance(flight: Flight, built: dict[str, Path]) -> Iterator[Instance]:
    """Freshly instantiated, for each flight in turn."""
    with Instance(built[flight.model]) as instance:
        yield instance


def nonsense(flight: Flight, k: int) -> dict[str, float | bool]:
    """Inputs that would be another flight."""
    return {name: 1.5 * value + 0.25 for name, value in flight.inputs(k).items()}


# -- one variable a call, or all in one -----------------------------------------------------------------


def test_all_inputs_in_one_call_are_the_same_as_one_a_call(instance: Instance, flight: Flight, plain: Rows) -> None:
    flight.begin(instance)
    for k, expected in enumerate(plain):
        inputs = flight.inputs(k)
        instance.fmu.setReal([instance.variables[name].valueReference for name in inputs], list(inputs.values()))
        instance.step(k * flight.h, flight.h)
        assert instance.everything() == expected


def test_one_variable_a_call_reads_the_same_as_all_in_one(instance: Instance, flight: Flight) -> None:
    flight.begin(instance)
    flight.fly(instance, 0, 3)
    names = instance.names("input", "output", "parameter", "local")
    assert len(names) > 50
    assert [instance.get(name)[0] for name in names] == instance.get(*names)
    assert {name: instance.value(name) for name in instance.variables} == instance.values()


def test_calls_for_no_variable_at_all_are_no_failure(instance: Instance, flight: Flight, plain: Rows) -> None:
    def call_for_nothing() -> None:
        for kind in ("Real", "Integer", "Boolean", "String"):
            assert getattr(instance.fmu, f"get{kind}")([]) == []
            getattr(instance.fmu, f"set{kind}")([], [])

    call_for_nothing()
    flight.begin(instance)
    call_for_nothing()
    assert flight.fly(instance, 0, STEPS) == plain


def test_reading_everything_at_any_time_and_twice_changes_nothing(
    instance: Instance, flight: Flight, plain: Rows
) -> None:
    def read() -> None:
        assert instance.everything() == instance.everything()

    read()
    instance.set({**flight.inputs(0), **flight.start})
    read()
    instance.fmu.setupExperiment(startTime=0.0)
    read()
    instance.fmu.enterInitializationMode()
    read()
    instance.fmu.exitInitializationMode()
    for k, expected in enumerate(plain):
        read()
        instance.set(flight.inputs(k))
        read()
        instance.step(k * flight.h, flight.h)
        assert instance.everything() == expected


def test_what_was_set_is_what_is_read_back_in_every_phase(instance: Instance, flight: Flight) -> None:
    def assert_read_back(k: int) -> None:
        inputs = flight.inputs(k)
        instance.set(inputs)
        assert instance.get(*inputs) == list(inputs.values())

    assert_read_back(1)
    instance.fmu.setupExperiment(startTime=0.0)
    assert_read_back(2)
    instance.fmu.enterInitializationMode()
    assert_read_back(3)
    instance.fmu.exitInitializationMode()
    assert_read_back(4)
    instance.step(0.0, flight.h)
    assert instance.get(*flight.inputs(4)) == list(flight.inputs(4).values())


@pytest.mark.parametrize("model", PAIR)
def test_parameters_are_read_back_one_by_one_while_they_do_not_fit_together_yet(
    model: str, built: dict[str, Path]
) -> None:
    with Instance(built[model]) as instance:
        instance.fmu.setupExperiment(startTime=0.0)
        instance.fmu.enterInitializationMode()
        for name, value in {"inertia.xy": 2.0, "inertia.xx": 3.0, "inertia.yy": 3.0}.items():
            instance.set({name: value})  # not positive definite until the last
            assert instance.get(name) == [value]
        instance.fmu.exitInitializationMode()


# -- before the first step ------------------------------------------------------------------------------


def test_inputs_set_twice_count_as_set_last(instance: Instance, flight: Flight, plain: Rows) -> None:
    instance.set(nonsense(flight, 0))
    flight.begin(instance)
    for k, expected in enumerate(plain):
        instance.set(nonsense(flight, k))
        instance.set(flight.inputs(k))
        instance.step(k * flight.h, flight.h)
        assert instance.everything() == expected


@pytest.mark.parametrize("when", ["instantiated", "initialisation mode"])
def test_start_values_may_be_set_before_or_in_initialisation_mode(
    when: str, instance: Instance, flight: Flight, plain: Rows
) -> None:
    values = {**flight.inputs(0), **flight.start}
    if when == "instantiated":
        instance.set(values)
    instance.fmu.setupExperiment(startTime=0.0)
    instance.fmu.enterInitializationMode()
    if when == "initialisation mode":
        instance.set(values)
    instance.fmu.exitInitializationMode()
    assert flight.fly(instance, 0, STEPS) == plain


@pytest.mark.parametrize("setup", [{"tolerance": 1e-4, "stopTime": 30.0}, {"stopTime": 1e300}], ids=str)
def test_stop_time_and_tolerance_change_nothing_up_to_the_stop(
    setup: dict[str, float], instance: Instance, flight: Flight, plain: Rows
) -> None:
    instance.set({**flight.inputs(0), **flight.start})
    instance.fmu.setupExperiment(startTime=0.0, **setup)
    instance.fmu.enterInitializationMode()
    instance.fmu.exitInitializationMode()
    assert flight.fly(instance, 0, STEPS) == plain


def test_exchanging_many_times_in_initialisation_mode_is_as_good_as_once(
    instance: Instance, flight: Flight, plain: Rows
) -> None:
    """As libcosim and ecos do, until the values no longer change or a number of times."""
    instance.fmu.setupExperiment(startTime=0.0)
    instance.fmu.enterInitializationMode()
    instance.set(flight.start)
    for k in range(5):
        instance.set(nonsense(flight, k))
        instance.everything()
        instance.set(flight.inputs(0))
        outputs = instance.get(*instance.names("output"))
        assert instance.get(*instance.names("output")) == outputs
    instance.fmu.exitInitializationMode()
    assert instance.get(*instance.names("output")) == outputs
    assert flight.fly(instance, 0, STEPS) == plain


def test_outputs_read_before_the_first_step_are_the_initial_ones(plant: Instance, controller: Instance) -> None:
    plant.initialise({"initial.position.x": 0.3, "initial.velocity.z": -0.2})
    assert plant.get("position.x", "velocity.z") == [0.3, -0.2]
    assert plant.get(*(f"quaternion.{a}" for a in "xyzw")) == pytest.approx([0.1699, 0.3058, 0.1699, 0.9212], abs=1e-4)
    controller.initialise(MEASUREMENT)
    assert controller.get(*COMMAND) == pytest.approx(law_command(0.0), rel=1e-12)
    assert controller.value("sample_count") == 0


def exchanged_once(loop: Loop) -> None:
    loop.measure()
    loop.command()


def exchanged_until_it_settles(loop: Loop) -> None:
    for _ in range(5):
        loop.command()
        loop.measure()


def not_exchanged(loop: Loop) -> None:
    """The controller's inputs stay at their starts."""


def zeroed(loop: Loop) -> None:
    for instance in loop.both:
        instance.set(dict.fromkeys(instance.names("input"), 0.0))


@pytest.mark.parametrize("exchange", [exchanged_until_it_settles, not_exchanged, zeroed])
def test_what_is_exchanged_before_initialisation_ends_does_not_matter_if_the_controller_steps_first(
    exchange: Callable[[Loop], None], built: dict[str, Path]
) -> None:
    flights = []
    for prepare in (exchanged_once, exchange):
        with Instance(built[CONTROLLER]) as controller, Instance(built[PLANT]) as plant:
            loop = Loop(controller, plant)
            loop.enter_initialisation()
            prepare(loop)
            loop.exit_initialisation()
            flights.append(loop.fly(20, 0.005))
    assert flights[0] == flights[1]


def test_zeroed_connectors_are_hover_without_torque_until_the_first_measurement(controller: Instance) -> None:
    controller.initialise(dict.fromkeys(controller.names("input"), 0.0))
    assert controller.get(*COMMAND) == pytest.approx([9.81, 0.0, 0.0, 0.0], rel=1e-12)
    controller.step(0.0, 0.01)
    assert controller.get(*COMMAND) == pytest.approx([9.81, 0.0, 0.0, 0.0], rel=1e-12)
    controller.set(MEASUREMENT)
    controller.step(0.01, 0.01)
    assert controller.get(*COMMAND) == pytest.approx(law_command(0.01), rel=1e-12)
    assert controller.value("sample_count") == 2
    assert ["no measurement" in message.text for message in controller.messages] == [True]


def test_a_loop_whose_connectors_are_zeroed_before_the_first_step_settles(
    controller: Instance, plant: Instance
) -> None:
    """As fmpy.ssp does: nothing measured and no thrust in the first step, all values exchanged after each."""
    loop = Loop(controller, plant)
    zeroed(loop)
    loop.enter_initialisation()
    loop.exit_initialisation()
    loop.fly_and_exchange_afterwards(0, 700, 0.01)
    error = math.dist(controller.get(*(f"position_error.{axis}" for axis in "xyz")), (0.0, 0.0, 0.0))
    assert error < 0.05
    assert len(controller.messages) == 1


# -- going back ----------------------------------------------------------------------------------------------


def test_a_master_that_does_not_promise_to_never_go_back_flies_the_same(
    instance: Instance, flight: Flight, plain: Rows
) -> None:
    flight.begin(instance)
    for k, expected in enumerate(plain):
        instance.set(flight.inputs(k))
        instance.fmu.doStep(k * flight.h, flight.h, noSetFMUStatePriorToCurrentPoint=fmi2False)
        assert instance.everything() == expected


def test_a_step_that_is_taken_back_and_repeated_leaves_no_trace(
    instance: Instance, flight: Flight, plain: Rows
) -> None:
    flight.begin(instance)
    for k, expected in enumerate(plain):
        state = instance.fmu.getFMUstate()
        for factor in (3.0, 0.5):
            instance.set(nonsense(flight, k))
            instance.step(k * flight.h, factor * flight.h)
            instance.fmu.setFMUstate(state)
        instance.fmu.freeFMUstate(state)
        instance.set(flight.inputs(k))
        instance.step(k * flight.h, flight.h)
        assert instance.everything() == expected


def test_taking_initialisation_back_and_repeating_it_leaves_no_trace(
    instance: Instance, flight: Flight, plain: Rows
) -> None:
    instance.fmu.setupExperiment(startTime=0.0)
    instance.fmu.enterInitializationMode()
    state = instance.fmu.getFMUstate()
    instance.set({**nonsense(flight, 0), "gravity": 5.0})
    instance.fmu.exitInitializationMode()
    instance.step(0.0, flight.h)
    instance.fmu.setFMUstate(state)
    instance.fmu.freeFMUstate(state)
    instance.set({**flight.inputs(0), **flight.start})
    instance.fmu.exitInitializationMode()
    assert flight.fly(instance, 0, STEPS) == plain


# -- the end, and again ---------------------------------------------------------------------------------


def test_outputs_can_be_read_after_terminate(instance: Instance, flight: Flight, plain: Rows) -> None:
    flight.begin(instance)
    flight.fly(instance, 0, STEPS)
    instance.fmu.terminate()
    assert instance.everything() == plain[-1]


def test_reset_from_any_phase_gives_the_first_flight_again(instance: Instance, flight: Flight, plain: Rows) -> None:
    for phase in ("instantiated", "initialisation mode", "stepping", "terminated", "failed"):
        instance.set({"gravity": 5.0})
        if phase == "initialisation mode":
            instance.fmu.setupExperiment(startTime=3.0)
            instance.fmu.enterInitializationMode()
        elif phase != "instantiated":
            instance.initialise(nonsense(flight, 1), start=3.0)
            instance.step(3.0, 0.5)
        if phase == "terminated":
            instance.fmu.terminate()
        if phase == "failed":
            with pytest.raises(FMICallException):
                instance.set({"mass": 1.0})
        instance.fmu.reset()
        flight.begin(instance)
        assert flight.fly(instance, 0, STEPS) == plain, phase
        instance.fmu.reset()


@pytest.mark.parametrize("model", sample([*PAIR], 1))
def test_an_instance_may_be_freed_in_any_phase_without_terminate(model: str, built: dict[str, Path]) -> None:
    assert run_script("freed_anywhere", built[model]) == {"freed": 50, "flies as before": True}


@pytest.mark.parametrize("model", sample([*PAIR], 1))
def test_no_order_of_calls_brings_the_process_down(model: str, built: dict[str, Path]) -> None:
    result = run_script("any_calls", built[model], str(1 + [*PAIR].index(model)))
    assert result["failures"] > tries(500, sampled=60)  # or too little was out of order
    assert result["revived"] > tries(50, sampled=5)


def test_fmus_fly_on_while_others_are_unloaded_and_their_files_deleted(
    built: dict[str, Path], alone: dict[str, Rows]
) -> None:
    result = run_script("unloaded", built[PLANT], built[CONTROLLER])
    assert result["rows"] == alone
    for said in result["said"]:
        assert "mass: a fixed parameter cannot be set after initialisation" in said


# -- names, folders, log --------------------------------------------------------------------------------


@pytest.mark.parametrize("called", ["", "two words", "Quadrocoptère 四旋翼", "100 %s", "a" * 1000])
def test_an_instance_may_have_any_name(called: str, built: dict[str, Path]) -> None:
    with Instance(built[PLANT], name=called) as first, Instance(built[PLANT], name=called) as second:
        first.initialise({})
        second.initialise({})
        with pytest.raises(FMICallException):
            first.set({"mass": 1.0})
        assert {message.instance for message in first.messages} == {called}
        assert second.messages == []
        second.step(0.0, 0.01)


PLACES = [
    ("folder with spaces", "URI"),
    ("folder with spaces", "URI with a slash at its end"),
    ("folder with spaces", "path"),
    ("Jürgen", "path"),
    ("Jürgen", "URI"),
    ("copy (2)", "URI"),
    ("copy (2)", "path with escapes"),
    ("100% [四旋翼]", "URI"),
    ("100% [四旋翼]", "path"),
    ("folder", "URI with one slash"),
    ("folder", "URI with a host"),
]
"""A folder, and the form in which an FMU is told where that is."""


@pytest.fixture(scope="module")
def commands(built: dict[str, Path], tmp_path_factory: pytest.TempPathFactory) -> dict[tuple[str, str], list[float]]:
    """Of the controller in each place."""
    folder = tmp_path_factory.mktemp("places")
    asked = [(str(folder / str(k) / name), form) for k, (name, form) in enumerate(sample(PLACES, 4))]
    return dict(zip(sample(PLACES, 4), run_script("fly_from", built[CONTROLLER], json.dumps(asked)), strict=True))


@pytest.mark.parametrize("place", sample(PLACES, 4), ids="-".join)
def test_an_fmu_finds_its_resources(place: tuple[str, str], commands: dict[tuple[str, str], list[float]]) -> None:
    assert commands[place] == pytest.approx(law_command(0.0), rel=1e-12)


def test_without_logging_a_failure_is_logged_by_native_fmus_and_a_warning_by_none(
    making: Making, built: dict[str, Path]
) -> None:
    for model in PAIR:  # the library of pythonfmu 0.7.0 logs nothing then
        with Instance(built[model], logging=False) as instance:
            with pytest.raises(FMICallException, match=f"status {making.failure} "):
                instance.initialise({"mass": -1.0})
            assert ["mass = -1.0: expected" in message.text for message in instance.messages] == [True] * making.native
    with Instance(built[CONTROLLER], logging=False) as controller:
        controller.initialise(dict.fromkeys(controller.names("input"), 0.0))
        assert controller.messages == []


def test_logging_can_be_switched_on_and_off(controller: Instance) -> None:
    nothing = dict.fromkeys(controller.names("input"), 0.0)
    for on in (False, True):
        controller.fmu.setDebugLogging(on, [])
        controller.initialise(nothing)
        assert ["no measurement" in message.text for message in controller.messages] == [True] * on
        controller.fmu.reset()


def log_of_a_warning_and_a_divergence(controller: Instance) -> set[bytes | None]:
    """The categories of what a zero quaternion and a velocity of 1e200 m/s have logged."""
    controller.initialise({"quaternion.w": 0.0})
    controller.set({**MEASUREMENT, "velocity.x": 1e200})
    with pytest.raises(FMICallException):
        controller.step(0.0, 0.01)
    return {message.category for message in controller.messages}


@pytest.mark.parametrize(
    "categories", [["logStatusWarning"], ["divergence"], ["divergence", "logStatusWarning"], ["events"]], ids=str
)
def test_only_messages_of_the_categories_asked_for_are_logged(categories: list[str], controller: Instance) -> None:
    controller.fmu.setDebugLogging(True, categories)
    logged = {category.encode() for category in categories} - {b"events"}
    assert log_of_a_warning_and_a_divergence(controller) == logged


def test_a_failure_that_is_no_divergence_is_logged_to_those_who_ask_for_categories(
    making: Making, controller: Instance
) -> None:
    if not making.native:
        pytest.xfail("pythonfmu 0.7.0 logs all failures but divergence without a category, so filters hide them")
    controller.fmu.setDebugLogging(True, [category.name for category in controller.description.logCategories])
    with pytest.raises(FMICallException):
        controller.initialise({"mass": -1.0})
    assert "mass = -1.0: expected" in controller.messages[-1].text


def test_the_declared_log_categories_are_those_that_messages_carry(controller: Instance) -> None:
    declared = {category.name.encode() for category in controller.description.logCategories}
    logged = log_of_a_warning_and_a_divergence(controller) - {None}
    controller.fmu.reset()
    controller.messages.clear()
    with pytest.raises(FMICallException):
        controller.initialise({"mass": -1.0})
    assert logged | {message.category for message in controller.messages} - {None} == declared


# -- threads --------------------------------------------------------------------------------------------


@in_test_all
def test_instances_stepped_from_several_threads_at_once_fly_as_if_alone(
    built: dict[str, Path], alone: dict[str, Rows]
) -> None:
    expected = {f"{name} {number}": rows for name, rows in alone.items() for number in range(3)}
    ways = run_script("from_threads", built[PLANT], built[CONTROLLER])
    assert set(ways) == {"in_new_threads", "in_a_pool", "each_in_its_own"}
    for way, flown in ways.items():
        assert flown == expected, way


def test_instances_made_from_several_threads_at_once_leave_the_import_path_as_it_was(built: dict[str, Path]) -> None:
    assert run_script("instantiated_by_threads", *(built[model] for model in PAIR)) == {
        "made": tries(800, sampled=64),
        "path kept": True,
    }
