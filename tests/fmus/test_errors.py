"""Bad input: every kind fails with one line that names the variable, its value and what was expected."""

import json
import math
import os
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
from fmpy.fmi1 import FMICallException

from orchestration.components.building.models import MODELS
from orchestration.components.fmi.fmi2 import Fmi2Instance
from orchestration.foundation.basics.errors import SimulatorError, UsageError
from tests.extent import sample
from tests.fmus.archive import without_loader
from tests.fmus.instance import Instance
from tests.fmus.making import PAIR, Making
from tests.fmus.process import run, run_script

PLANT, CONTROLLER = "QuadrotorPlant", "UnifiedController"
Values = dict[str, float | bool]
Make = Callable[[str], Fmi2Instance]


@pytest.fixture
def make(built: dict[str, Path]) -> Iterator[Make]:
    """Makes simulators that are closed when the test ends."""
    made: list[Fmi2Instance] = []

    def make(model: str) -> Fmi2Instance:
        made.append(Fmi2Instance(built[model], "it"))
        return made[-1]

    yield make
    for simulator in made:
        simulator.close()


def initialise(simulator: Fmi2Instance, values: Values) -> None:
    for name, value in values.items():
        simulator.set(name, value)
    simulator.enter_initialization(0.0, math.inf)
    simulator.exit_initialization()


def refusal(call: Callable[[], object]) -> SimulatorError:
    with pytest.raises(SimulatorError) as raised:
        call()
    return raised.value


def assert_value_refused(error: SimulatorError, message: str) -> None:
    """The FMU's words about a value that was given are wrong usage, under the name of the instance."""
    assert isinstance(error, UsageError)
    assert_words(error, f"it.{message}", message)


def assert_readable(error: SimulatorError, model: str, function: str, message: str) -> None:
    """Any other failure names the model and the call."""
    assert not isinstance(error, UsageError)
    assert_words(error, f"it ({model}): {function}: {message}", message)


def assert_words(error: SimulatorError, start: str, message: str) -> None:
    """One line in the FMU's words, and its traceback, of Python, apart from it."""
    assert str(error).startswith(start)
    assert "\n" not in str(error)
    if error.details:
        assert error.details.startswith("Traceback (most recent call last):")
        assert message in error.details.splitlines()[-1]


def test_a_failure_has_a_traceback_where_there_is_python_inside(making: Making, make: Make) -> None:
    error = refusal(lambda: make(PLANT).step(0.0, 0.01))
    assert bool(error.details) == making.traceback


# -- parameters -----------------------------------------------------------------------------------------


class Bad(NamedTuple):
    """Start values that are refused, and the words."""

    model: str
    values: Values
    message: str

    @property
    def label(self) -> str:
        return f"{self.model}-{','.join(f'{name}={value}' for name, value in self.values.items())}"


POSITIVE = "expected a finite value > 0"
NOT_NEGATIVE = "expected a finite value >= 0"
DEFINITE = "expected a positive definite matrix"

BAD_PARAMETERS = [
    *(Bad(model, {"mass": 0.0}, f"mass = 0.0: {POSITIVE}") for model in MODELS),
    *(Bad(model, {"inertia.xx": 0.0}, "inertia.{xx,yy,zz,xy,xz,yz} = xx 0, yy 1") for model in MODELS),
    Bad(
        PLANT,
        {"inertia.xy": 0.8, "inertia.xz": 0.8, "inertia.yz": -0.8},  # every 2x2 minor is positive
        f"inertia.{{xx,yy,zz,xy,xz,yz}} = xx 1, yy 1, zz 1, xy 0.8, xz 0.8, yz -0.8: {DEFINITE}",
    ),
    Bad(PLANT, {"thrust_max": 2.0, "thrust_min": 3.0}, "thrust_min = 3.0: expected at most 2.0, the largest"),
    Bad(
        PLANT,
        {"motor.thrust_max": 2.0, "motor.thrust_min": 3.0},
        "motor.thrust_min = 3.0: expected at most 2.0, the largest",
    ),
    Bad(PLANT, {"motor.time_constant.down": -0.1}, f"motor.time_constant.down = -0.1: {NOT_NEGATIVE}"),
    Bad(
        PLANT,
        {f"initial.quaternion.{axis}": 0.0 for axis in "xyzw"},
        "initial.quaternion = (0.0, 0.0, 0.0, 0.0): expected a quaternion that is not zero",
    ),
    Bad(CONTROLLER, {"surface_exponent": 1.5}, f"surface_exponent = 1.5: {POSITIVE} and <= 1"),
    Bad(CONTROLLER, {"gain.translation.y": -2.0}, f"gain.translation.y = -2.0: {NOT_NEGATIVE}"),
]


@pytest.mark.parametrize("bad", BAD_PARAMETERS, ids=lambda bad: bad.label)
def test_a_parameter_out_of_range_fails_initialisation(bad: Bad, make: Make) -> None:
    error = refusal(lambda: initialise(make(bad.model), bad.values))
    assert_value_refused(error, bad.message)
    assert not error.divergence


@pytest.mark.parametrize("model", MODELS)
def test_a_matrix_that_is_not_positive_definite_is_called_so(model: str, make: Make) -> None:
    error = refusal(lambda: initialise(make(model), {"inertia.zz": -1.0}))
    assert str(error).endswith(f"zz -1, xy 0, xz 0, yz 0: {DEFINITE}")


@pytest.mark.parametrize("order", [1, -1])
def test_parameters_may_pass_through_what_is_not_allowed_together(order: int, make: Make) -> None:
    """An inertia that is only positive definite once all entries are set, in any order."""
    entries: Values = {"inertia.xy": 2.0, "inertia.xx": 3.0, "inertia.yy": 3.0}
    initialise(make(PLANT), dict(list(entries.items())[::order]))


def test_a_tunable_parameter_out_of_range_fails_the_next_step(make: Make) -> None:
    controller = make(CONTROLLER)
    initialise(controller, {})
    controller.step(0.0, 0.01)
    controller.set("boundary_layer", -1.0)
    error = refusal(lambda: controller.step(0.01, 0.01))
    assert_value_refused(error, f"boundary_layer = -1.0: {POSITIVE}")
    assert not error.divergence


# -- values that are not finite -------------------------------------------------------------------------

NOT_FINITE = [
    (PLANT, "thrust", math.nan),
    (PLANT, "external_force.z", -math.inf),
    (CONTROLLER, "position.x", math.inf),
    (CONTROLLER, "quaternion.w", -math.inf),
    (CONTROLLER, "reference.snap.z", math.nan),
]
"""Inputs, with each value of a plant and of a controller that is none"""


@pytest.mark.parametrize(
    ("model", "name", "value"), [*NOT_FINITE, (PLANT, "mass", math.inf), (CONTROLLER, "gain.eta", math.nan)]
)
def test_a_start_value_that_is_not_finite_is_refused(model: str, name: str, value: float, make: Make) -> None:
    simulator = make(model)
    error = refusal(lambda: simulator.set(name, value))
    assert_value_refused(error, f"{name} = {value}: expected a finite value")
    assert not error.divergence


@pytest.mark.parametrize(("model", "name", "value"), NOT_FINITE)
def test_an_input_that_is_not_finite_is_refused_between_steps(model: str, name: str, value: float, make: Make) -> None:
    simulator = make(model)
    names = simulator.names("input")
    inputs = np.array([float(simulator.get(name)) for name in names])
    write = simulator.writer(names, inputs)
    initialise(simulator, {})
    write()
    simulator.step(0.0, 0.01)
    inputs[names.index(name)] = value
    error = refusal(write)
    assert_readable(error, model, "fmi2SetReal", f"{name} = {value}: expected a finite value")
    assert not error.divergence


# -- steps ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("model", PAIR)
@pytest.mark.parametrize(
    ("t", "h", "message"),
    [
        (0.0, -0.01, "communicationStepSize = -0.01: expected a positive number of seconds"),
        (0.0, 0.0, "communicationStepSize = 0.0: expected a positive number of seconds"),
        (0.0, math.nan, "communicationStepSize = nan: expected a positive number of seconds"),
        (0.0, math.inf, "communicationStepSize = inf: expected a positive number of seconds"),
        (math.nan, 0.01, "currentCommunicationPoint = nan: expected a finite time"),
    ],
)
def test_a_step_that_leads_nowhere_is_refused(model: str, t: float, h: float, message: str, make: Make) -> None:
    simulator = make(model)
    initialise(simulator, {})
    error = refusal(lambda: simulator.step(t, h))
    assert_readable(error, model, "fmi2DoStep", message)
    assert not error.divergence


@pytest.mark.parametrize("model", PAIR)
def test_a_step_before_initialisation_is_refused(model: str, make: Make) -> None:
    simulator = make(model)
    error = refusal(lambda: simulator.step(0.0, 0.01))
    assert_readable(error, model, "fmi2DoStep", "fmi2DoStep in phase instantiated: expected phase stepping")


@pytest.mark.parametrize(
    ("model", "name", "message"),
    [
        (PLANT, "mass", "mass: a fixed parameter cannot be set after initialisation"),
        (PLANT, "position.x", "position.x: a variable with causality output cannot be set"),
        (CONTROLLER, "sample_period", "sample_period: a fixed parameter cannot be set after initialisation"),
        (CONTROLLER, "energy", "energy: a variable with causality local cannot be set"),
    ],
)
def test_what_is_not_open_to_change_is_refused(model: str, name: str, message: str, make: Make) -> None:
    simulator = make(model)
    initialise(simulator, {})
    assert_readable(refusal(lambda: simulator.set(name, 1.0)), model, "fmi2SetReal", message)


@pytest.mark.parametrize("values", [{"max_internal_step": 1e-9}, {"max_internal_step": 5e-324}, {}])
def test_a_plant_step_of_too_many_internal_steps_is_refused(values: Values, make: Make) -> None:
    plant = make(PLANT)
    initialise(plant, values)
    h, largest = (0.01, values["max_internal_step"]) if values else (1e4, 0.002)
    error = refusal(lambda: plant.step(0.0, h))
    message = f"communicationStepSize = {h}: expected at most 100000 times max_internal_step = {largest} s"
    assert_readable(error, PLANT, "fmi2DoStep", message)
    assert not error.divergence


@pytest.mark.parametrize("reference", [2**31 - 1, 2**31, 2**32 - 1])
@pytest.mark.parametrize("model", PAIR)
def test_a_value_reference_that_is_none_is_refused_as_it_was_given(
    model: str, reference: int, built: dict[str, Path]
) -> None:
    with Instance(built[model]) as instance:
        for get in (instance.fmu.getReal, instance.fmu.getInteger, instance.fmu.getBoolean):
            with pytest.raises(FMICallException):
                get([reference])
            assert f"value reference [{reference}]: expected one of " in instance.messages[-1].text


# -- divergence -----------------------------------------------------------------------------------------

FREE_FALL: Values = {"use_reference_inputs": True, "reference.acceleration.z": 20.0}
"""A wanted acceleration of more than gravity downwards: n + g - F_z is 0 and (12) has no solution."""


def test_a_virtual_control_without_attitude_is_divergence_at_initialisation(make: Make) -> None:
    error = refusal(lambda: initialise(make(CONTROLLER), FREE_FALL))
    assert_readable(error, CONTROLLER, "fmi2ExitInitializationMode", "virtual control F = (")
    assert "20.0) m/s2: expected n = |g z - F| and n + g - F.z of at least 1e-09" in str(error)
    assert error.divergence


def test_a_virtual_control_that_cancels_gravity_is_divergence(make: Make) -> None:
    values: Values = {**FREE_FALL, "reference.acceleration.z": 9.81}  # n = 0
    error = refusal(lambda: initialise(make(CONTROLLER), values))
    assert "virtual control F = (" in str(error)
    assert error.divergence


def test_a_virtual_control_without_attitude_is_divergence_in_a_step(make: Make) -> None:
    controller = make(CONTROLLER)
    initialise(controller, {"use_reference_inputs": True})
    controller.step(0.0, 0.01)
    controller.set("reference.acceleration.z", 20.0)
    error = refusal(lambda: controller.step(0.01, 0.01))
    assert_readable(error, CONTROLLER, "fmi2DoStep", "virtual control F = (")
    assert error.divergence


@pytest.mark.parametrize(
    "values",
    [
        {"position.x": 1.0, "velocity.x": 1e200},
        {"angular_velocity.x": 1e200, "angular_velocity.z": 1e200, "inertia.xx": 2.0},
    ],
)
def test_a_command_that_no_float_can_hold_is_divergence(values: Values, make: Make) -> None:
    error = refusal(lambda: initialise(make(CONTROLLER), values))
    assert error.divergence
    assert "expected" in str(error)
    assert "\n" not in str(error)


@pytest.mark.parametrize(
    ("start", "inputs"),
    [
        ({"mass": 1e-3}, {"external_force.x": 1e308}),
        ({"thrust_max": 1e308, "mass": 1e-3}, {"thrust": 1e308}),
        ({"torque_max": 1e308}, {"torque.x": 1e308}),
        ({"initial.angular_velocity.y": 1e200}, {}),
    ],
)
def test_a_plant_state_that_overflows_is_divergence(start: Values, inputs: Values, make: Make) -> None:
    plant = make(PLANT)
    initialise(plant, start)
    for name, value in inputs.items():
        plant.set(name, value)

    def fly() -> None:
        for k in range(5):
            plant.step(0.01 * k, 0.01)

    error = refusal(fly)
    assert str(error).startswith("it.position.x = ")
    assert str(error).endswith(": expected a finite value")
    assert "\n" not in str(error)
    assert error.divergence


# -- where it is unpacked -------------------------------------------------------------------------------

LOAD = """
import sys
from pathlib import Path
from orchestration.foundation.basics.errors import QuadcosimError
from orchestration.components.fmi.fmi2 import Fmi2Instance
try:
    Fmi2Instance(Path(sys.argv[1]), "it").close()
except QuadcosimError as error:
    sys.exit(str(error))
"""


def loaded_in(folder: Path, fmu: Path) -> str:
    """What is said when the adapter unpacks an FMU in `folder`; pythonfmu may bring the process down there."""
    folder.mkdir()
    done = run(sys.executable, "-c", LOAD, str(fmu), environment={"TMPDIR": str(folder)})
    assert done.returncode in (0, 1), done.stderr
    assert list(folder.iterdir()) == []
    return done.stderr


@pytest.mark.usefixtures("python_inside")
@pytest.mark.parametrize("name", sample(["Jürgen", "copy (2)", "a%20b"], 1))
def test_a_temporary_folder_that_pythonfmu_cannot_find_is_refused(
    name: str, built: dict[str, Path], tmp_path: Path
) -> None:
    plain = without_loader(built[PLANT], tmp_path)
    said = loaded_in(tmp_path / name, plain)
    assert said.startswith(f"{plain}: expected an FMU for co-simulation that loads here: unpacked in {tmp_path / name}")
    assert "other characters than ASCII letters, digits, spaces and - . _ ~: set TMPDIR" in said
    assert said.count("\n") == 1


@pytest.mark.usefixtures("python_inside")
def test_a_temporary_folder_with_spaces_will_do_for_pythonfmu_alone(built: dict[str, Path], tmp_path: Path) -> None:
    assert loaded_in(tmp_path / "with many spaces", without_loader(built[PLANT], tmp_path)) == ""


@pytest.mark.parametrize("name", sample(["Jürgen", "with many spaces", "100% (2)"], 1))
def test_behind_the_loader_any_temporary_folder_will_do(name: str, built: dict[str, Path], tmp_path: Path) -> None:
    assert loaded_in(tmp_path / name, built[PLANT]) == ""


@pytest.mark.usefixtures("python_inside")
@pytest.mark.parametrize("name", [b"a%20b", b"J\xfcrgen"])
def test_two_folders_that_pythonfmu_cannot_be_given_are_named_in_one_line(
    name: bytes, built: dict[str, Path], tmp_path: Path
) -> None:
    said = loaded_in(tmp_path / os.fsdecode(name), built[PLANT])
    assert "expected a path in UTF-8, without %20 and file:// in it" in said
    assert said.count("\n") == 1


# -- text and aftermath ---------------------------------------------------------------------------------


@pytest.mark.usefixtures("python_inside")
@pytest.mark.parametrize("text", ["\ud800", "a\0b"])
def test_text_that_utf_8_does_not_hold_is_escaped_in_a_message(text: str, make: Make) -> None:
    plant = make(PLANT)
    handle = plant._call("deSerializeFMUstate", json.dumps({"model": text, "reals": []}).encode())
    assert f"= ({text!r}, 0): expected" in str(refusal(lambda: plant._call("setFMUstate", handle)))


@pytest.mark.usefixtures("python_inside")
@pytest.mark.parametrize("text", ["100 %", "%s%n%d", "%%", "50%% of %p"])
def test_percent_signs_in_a_message_survive(text: str, make: Make) -> None:
    plant = make(PLANT)
    state = json.dumps({"model": text, "reals": []}).encode()
    handle = plant._call("deSerializeFMUstate", state)
    error = refusal(lambda: plant._call("setFMUstate", handle))
    assert f"FMU state (model, number of Reals) = ('{text}', 0): expected ('{PLANT}', " in str(error)
    assert f"('{text}', 0)" in error.details


@pytest.mark.usefixtures("python_inside")
def test_percent_signs_survive_the_format_of_fmpys_own_logger(
    built: dict[str, Path], capsys: pytest.CaptureFixture[str]
) -> None:
    state = json.dumps({"model": "100 %s%n %d", "reals": []}).encode()
    with Instance(built[PLANT], default_logger=True) as plant, pytest.raises(FMICallException):
        plant.restore(state)
    assert "FMU state (model, number of Reals) = ('100 %s%n %d', 0): expected" in capsys.readouterr().out


def test_a_failed_fmu_is_not_called_again(make: Make) -> None:
    plant = make(PLANT)
    refusal(lambda: plant.set("mass", math.nan))
    error = refusal(lambda: plant.set("mass", 1.0))
    assert str(error) == "it: the FMU has failed and is not called again"
    plant.close()
    plant.close()


def test_a_failure_does_not_disturb_another_instance(make: Make) -> None:
    failing, healthy = make(CONTROLLER), make(CONTROLLER)
    initialise(healthy, {})
    healthy.step(0.0, 0.01)
    error = refusal(lambda: initialise(failing, FREE_FALL))
    assert_readable(error, CONTROLLER, "fmi2ExitInitializationMode", "virtual control F = (")  # its own words
    healthy.step(0.01, 0.01)
    assert healthy.get("sample_count") == 2


@pytest.mark.parametrize(("model", "logger"), sample([(CONTROLLER, "own"), (PLANT, "default")], 1))
def test_calls_after_a_failure_do_not_crash_and_reset_revives(
    model: str, logger: str, making: Making, built: dict[str, Path]
) -> None:
    result = run_script("calls_after_failure", built[model], logger, str(making.failure))
    assert result == {"repetitions": 60, "failures as expected": True, "revived as new": True}
