"""Saved states: going on from one is the same flight, to the last bit."""

import json
from collections.abc import Iterator
from pathlib import Path

import pytest
from fmpy.fmi1 import FMICallException

from orchestration.components.fmi.fmi2 import Fmi2Instance
from orchestration.foundation.basics.errors import SimulatorError
from tests.fmus.flights import FLIGHTS, Flight
from tests.fmus.instance import Instance
from tests.fmus.making import PAIR, Making
from tests.fmus.process import run_script

SAVED, END = 7, 20  # step at which the state is taken, and the end of the flight


@pytest.fixture
def fmu(flight: Flight, built: dict[str, Path]) -> Path:
    return built[flight.model]


@pytest.fixture
def instance(flight: Flight, fmu: Path) -> Iterator[Instance]:
    """Flown up to the point where the state is taken."""
    with Instance(fmu) as instance:
        flight.begin(instance)
        flight.fly(instance, 0, SAVED)
        yield instance


def test_restoring_and_stepping_again_repeats_the_flight(instance: Instance, flight: Flight) -> None:
    state = instance.fmu.getFMUstate()
    at_the_state = instance.everything()
    first = flight.fly(instance, SAVED, END)
    instance.fmu.setFMUstate(state)
    assert instance.everything() == at_the_state
    assert flight.fly(instance, SAVED, END) == first
    assert first[0] != first[-1]  # a flight that stands still would prove nothing
    instance.fmu.freeFMUstate(state)


def test_a_state_can_be_restored_more_than_once(instance: Instance, flight: Flight) -> None:
    state = instance.fmu.getFMUstate()
    flights = []
    for _ in range(3):
        instance.fmu.setFMUstate(state)
        flights.append(flight.fly(instance, SAVED, END))
    instance.fmu.freeFMUstate(state)
    assert flights[0] == flights[1] == flights[2]


def test_serialising_a_restored_state_gives_the_same_bytes(instance: Instance, flight: Flight) -> None:
    content = instance.save()
    flight.fly(instance, SAVED, END)
    assert instance.save() != content
    instance.restore(content)
    assert instance.save() == content


def test_taking_a_state_does_not_change_the_flight(instance: Instance, flight: Flight, fmu: Path) -> None:
    with Instance(fmu) as undisturbed:
        flight.begin(undisturbed)
        expected = flight.fly(undisturbed, 0, END)[SAVED:]
    instance.save()
    assert flight.fly(instance, SAVED, END) == expected


def test_another_instance_goes_on_from_the_state(instance: Instance, flight: Flight, fmu: Path) -> None:
    content = instance.save()
    first = flight.fly(instance, SAVED, END)
    with Instance(fmu) as other:  # not initialised: the state says that it was
        other.restore(content)
        assert flight.fly(other, SAVED, END) == first


def test_an_instance_in_another_flight_goes_on_from_the_state(instance: Instance, flight: Flight, fmu: Path) -> None:
    content = instance.save()
    first = flight.fly(instance, SAVED, END)
    with Instance(fmu) as other:
        other.initialise({"mass": 3.0, "gravity": 5.0}, start=4.0)
        other.step(4.0, 0.5)
        other.restore(content)
        assert flight.fly(other, SAVED, END) == first


@pytest.fixture(scope="module")
def elsewhere(built: dict[str, Path], tmp_path_factory: pytest.TempPathFactory) -> dict[str, list[list[str]]]:
    """How each flight goes on from its state in a process that has flown nothing before."""
    folder, asked = tmp_path_factory.mktemp("states"), []
    for name, flight in FLIGHTS.items():
        with Instance(built[flight.model]) as instance:
            flight.begin(instance)
            flight.fly(instance, 0, SAVED)
            (folder / name).write_bytes(instance.save())
        asked.append((str(built[flight.model]), name, str(folder / name)))
    flown: dict[str, list[list[str]]] = run_script("continue_flight", json.dumps(asked), str(SAVED), str(END))
    return flown


def test_another_process_goes_on_from_the_state(
    instance: Instance, name: str, flight: Flight, elsewhere: dict[str, list[list[str]]]
) -> None:
    assert elsewhere[name] == flight.fly(instance, SAVED, END)


def test_the_hidden_lag_of_the_actuators_is_in_the_state(built: dict[str, Path]) -> None:
    """Two plants of which every variable is equal go on differently, each from its own state.

    The channels of native ones are variables, too, for solvers.
    """
    states, ends = [], []
    for torque in (0.0, 0.4):
        with Instance(built["QuadrotorPlant"]) as plant, Instance(built["QuadrotorPlant"]) as other:
            plant.initialise({"actuator_time_constant": 0.05, "torque.y": torque})
            other.restore(plant.save())
            other.set({"torque.y": 0.2})
            states.append([text for text in other.everything() if not text.startswith(("der(", "channels."))])
            other.step(0.0, 0.01)
            ends.append(other.everything())
    assert states[0] == states[1]
    assert ends[0] != ends[1]


def test_a_sample_that_is_pending_happens_once_when_due(built: dict[str, Path]) -> None:
    with Instance(built["UnifiedController"]) as controller:
        controller.initialise({})  # samples are due every 10 ms
        for k in range(6):
            controller.step(k * 0.004, 0.004)  # sampled at 0, 12 ms and 20 ms
        assert controller.value("sample_count") == 3
        content = controller.save()
        for _ in range(2):
            counts = []
            for k in range(6, 12):  # 24, 28, 32 (due since 30), 36, 40 (due), 44 ms
                controller.step(k * 0.004, 0.004)
                counts.append(controller.value("sample_count"))
            assert counts == [3, 3, 4, 4, 5, 5]
            controller.restore(content)
            assert controller.value("sample_count") == 3


def test_a_warning_is_not_repeated_after_a_restore(built: dict[str, Path]) -> None:
    with Instance(built["UnifiedController"]) as controller, Instance(built["UnifiedController"]) as other:
        controller.initialise({"quaternion.w": 0.0})  # a zero quaternion: no measurement
        assert len([m for m in controller.messages if "no measurement" in m.text]) == 1
        other.restore(controller.save())
        other.step(0.0, 0.01)
        assert other.messages == []


def test_a_parameter_that_waits_to_be_refused_is_refused_after_a_restore(built: dict[str, Path]) -> None:
    with Instance(built["UnifiedController"]) as controller, Instance(built["UnifiedController"]) as other:
        controller.initialise({})
        controller.set({"boundary_layer": -1.0})  # checked when the next step begins
        other.restore(controller.save())
        with pytest.raises(FMICallException):
            other.step(0.0, 0.01)
        assert "boundary_layer = -1.0: expected" in other.messages[-1].text


def test_bytes_that_are_no_state_are_refused_and_leave_an_fmu_that_can_be_freed(built: dict[str, Path]) -> None:
    for model in PAIR:
        assert run_script("restore_garbage", built[model]) == {"refused": 20, "revived": 10}


def test_a_changed_tunable_parameter_is_in_the_state(built: dict[str, Path]) -> None:
    flight = FLIGHTS["controller"]
    with Instance(built[flight.model]) as controller:
        flight.begin(controller)
        flight.fly(controller, 0, SAVED)
        controller.set({"gain.eta": 3.0})  # not seen by a step yet
        content = controller.save()
        first = flight.fly(controller, SAVED, END)
        controller.restore(content)
        controller.set({"gain.eta": 20.0})
        assert flight.fly(controller, SAVED, END) != first
        controller.restore(content)
        assert flight.fly(controller, SAVED, END) == first


def test_reset_and_flying_again_equals_the_first_flight(flight: Flight, fmu: Path) -> None:
    with Instance(fmu) as instance:
        flight.begin(instance)
        first = flight.fly(instance, 0, END)
        instance.fmu.reset()
        flight.begin(instance)
        assert flight.fly(instance, 0, END) == first


@pytest.mark.parametrize(
    ("mine", "other"), [("QuadrotorPlant", "UnifiedController"), ("UnifiedController", "QuadrotorPlant")]
)
def test_the_state_of_the_other_model_is_refused_in_words(mine: str, other: str, built: dict[str, Path]) -> None:
    with Instance(built[other]) as stranger:
        stranger.initialise({})
        content = stranger.save()
    with Instance(built[mine]) as instance:
        instance.initialise({})
        with pytest.raises(FMICallException):
            instance.restore(content)
        (message,) = (m.text for m in instance.messages if m.status > 1)
        assert f"FMU state (model, number of Reals) = ('{other}', " in message
        assert f"expected ('{mine}', " in message


def test_the_adapter_refuses_the_state_of_the_other_model_in_the_words_of_the_fmu(
    making: Making, built: dict[str, Path]
) -> None:
    with Fmi2Instance(built["UnifiedController"], "controller") as controller:
        controller.enter_initialization(0.0, 1.0)
        controller.exit_initialization()
        content = controller.save()
    with (
        Fmi2Instance(built["QuadrotorPlant"], "plant") as plant,
        pytest.raises(
            SimulatorError,
            match=making.state_is_refused_by + r": FMU state \(model, number of Reals\) = \('UnifiedController', ",
        ),
    ):
        plant.restore(content)
