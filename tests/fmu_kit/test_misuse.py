"""What every slave refuses by its base, shown with one controller and one plant."""

import json
import math
from functools import partial

import pytest

from controller_fmu.sliding_mode.slave import UnifiedController
from fmu_kit.slave import Slave
from plant_fmu.slave import QuadrotorPlant
from tests.slaves import assert_fails, put

pytestmark = pytest.mark.parametrize("model", [QuadrotorPlant, UnifiedController])
Model = type[Slave]
NOT_FINITE = (math.nan, math.inf, -math.inf)


def initialising(model: Model) -> Slave:
    slave = model(instance_name="s")
    slave.setup_experiment(0.0)
    slave.enter_initialization_mode()
    return slave


def started(model: Model) -> Slave:
    slave = initialising(model)
    slave.exit_initialization_mode()
    return slave


def test_start_value_that_is_not_finite_is_refused(model: Model) -> None:
    for v in [v for v in model.variables if v.causality in ("input", "parameter") and v.type == "Real"]:
        for value in NOT_FINITE:
            slave = model(instance_name="s")
            assert_fails(partial(put, slave, {v.name: value}), f"{v.name} = {value}", "expected a finite value")


def test_input_that_is_not_finite_is_refused_between_steps(model: Model) -> None:
    for v in [v for v in model.variables if v.causality == "input"]:
        for value in NOT_FINITE:
            slave = started(model)
            assert_fails(partial(put, slave, {v.name: value}), f"{v.name} = {value}", "expected a finite value")


def test_fixed_parameter_cannot_be_set_after_initialisation(model: Model) -> None:
    slave = started(model)
    for v in [v for v in model.variables if v.causality == "parameter" and v.variability == "fixed"]:
        set_value = getattr(slave, {"Boolean": "set_boolean", "Real": "set_real"}.get(v.type, "set_integer"))
        expected = (v.name, "a fixed parameter cannot be set after initialisation")
        assert_fails(partial(set_value, [model._index[v.name]], [1]), *expected)


def test_outputs_and_locals_cannot_be_set(model: Model) -> None:
    for v in [v for v in model.variables if v.causality in ("output", "local")]:
        for slave in (model(instance_name="s"), started(model)):
            set_value = slave.set_real if v.type == "Real" else slave.set_integer
            expected = (v.name, f"causality {v.causality} cannot be set")
            assert_fails(partial(set_value, [model._index[v.name]], [1]), *expected)


def test_calls_in_another_phase_are_refused(model: Model) -> None:
    new, ended = model(instance_name="s"), started(model)
    ended.terminate()
    for slave, phase in ((new, "instantiated"), (initialising(model), "initialization"), (ended, "terminated")):
        assert_fails(partial(slave.do_step, 0.0, 0.01), "fmi2DoStep", f"phase {phase}", "expected phase stepping")
    new = model(instance_name="s")
    assert_fails(new.exit_initialization_mode, "fmi2ExitInitializationMode", "expected phase initialization")
    slave = started(model)
    assert_fails(slave.enter_initialization_mode, "fmi2EnterInitializationMode", "expected phase instantiated")
    assert_fails(partial(started(model).setup_experiment, 0.0), "fmi2SetupExperiment", "expected phase instantiated")


def test_times_that_lead_nowhere_are_refused(model: Model) -> None:
    for h in (0.0, -0.01, math.nan, math.inf):
        step = partial(started(model).do_step, 0.0, h)
        assert_fails(step, f"communicationStepSize = {h}", "expected a positive")
    for t in (math.nan, math.inf):
        step, setup = partial(started(model).do_step, t, 0.01), partial(model(instance_name="s").setup_experiment, t)
        assert_fails(step, f"currentCommunicationPoint = {t}", "expected a finite time")
        assert_fails(setup, f"startTime = {t}", "expected a finite time")


def test_instance_that_failed_makes_no_more_steps(model: Model) -> None:
    slave = started(model)
    assert_fails(partial(slave.do_step, 0.0, 0.0), "communicationStepSize")
    assert_fails(partial(slave.do_step, 0.0, 0.01), "phase failed")


def test_failure_can_be_logged_as_a_printf_format(model: Model) -> None:
    assert "100 %%s" in repr(started(model)._failure_of(ValueError("100 %s")))


def test_state_of_another_model_is_refused(model: Model) -> None:
    state = {**started(model)._get_fmu_state(), "model": "SomethingElse"}
    assert_fails(lambda: started(model)._set_fmu_state(state), "SomethingElse", "expected", model.__name__)


def test_saved_state_does_not_follow_the_instance(model: Model) -> None:
    slave = started(model)
    state = slave._get_fmu_state()
    before = json.dumps(state)
    for _ in range(2):
        slave.do_step(0.0, 0.01)
        assert json.dumps(slave._get_fmu_state()) != before
        slave._set_fmu_state(state)
    assert json.dumps(state) == before
