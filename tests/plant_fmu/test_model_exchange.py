"""The plant for a solver of its host: the derivatives, and flights by them."""

import math
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
import pytest
from fmpy.fmi2 import FMU2Model

import quadcosim
from fmu_kit.errors import FmuError
from orchestration.components.building import fmus
from orchestration.simulation.runs.pause import fly_until, resume
from plant_fmu.slave import RECALL, QuadrotorPlant
from tests.fmus.expected import MEASUREMENT

KNOWN = {
    "lag": {"actuator_time_constant": 0.05},
    "motors": {"motor.thrust_max": 6.0, "motor.time_constant.up": 0.04, "motor.time_constant.down": 0.07},
    "enu": {"frame": 2, "actuator_time_constant": 0.05, "external_force.y": 0.3},
}
MOVING = {"initial.angular_velocity.x": 1.0, "initial.velocity.y": -2.0, "thrust": 9.0, "torque.y": 0.1}
FLIGHT = {**MOVING, "actuator_time_constant": 0.05, "payload.mass": 0.2, "payload.drop_time": 1.234}
NATIVES = ("native/QuadrotorPlant", "native/fmi3/QuadrotorPlant")


def plant(**values: float) -> QuadrotorPlant:
    """It after initialisation, with values by FMI names."""
    slave = QuadrotorPlant()
    for name, value in values.items():
        vr = next(i for i, v in enumerate(slave.variables) if v.name == name)
        if slave.variables[vr].type == "Real":
            slave.set_real([vr], [value])
        else:
            slave.set_integer([vr], [int(value)])
    slave.setup_experiment(0.0)
    slave.enter_initialization_mode()
    slave.exit_initialization_mode()
    return slave


def states(slave: QuadrotorPlant) -> np.ndarray:
    of = (slave.position, slave.velocity, slave.quaternion, slave.angular_velocity)
    outputs = slave.get_real(list(range(7, 20)))  # in the axes of the FMU
    assert len([part for each in of for part in each]) == len(outputs)
    return np.array([*outputs, *slave._channels])


@pytest.mark.parametrize("name", [*KNOWN])
def test_the_derivatives_are_those_of_the_motion_in_steps(name: str) -> None:
    slave, h = plant(**MOVING, **KNOWN[name]), 1e-5
    for vr, value in ((0, 12.0), (1, 0.2)):
        slave.set_real([vr], [value])  # so that actuators move
    before, rates = states(slave), np.array(slave._derive(0.0, 0.0)[:-1])
    slave.do_step(0.0, h)
    middle = 0.5 * (rates + np.array(slave._derive(h, h)[:-1]))
    assert (states(slave) - before) / h == pytest.approx(middle, abs=1e-5)
    assert np.abs(rates[13:]).max() > 0.5


def test_a_solver_finds_every_output_with_its_value_after_the_states_are_set() -> None:
    continuous = [i for i, v in enumerate(QuadrotorPlant.variables) if v.variability == "continuous"]
    seen = [i for i in continuous if QuadrotorPlant.variables[i].causality in ("output", "local")]
    there, slave = plant(**MOVING, **{"initial.angular_velocity.z": 1.0}), plant()
    there.do_step(0.0, 0.1)
    before, expected = np.array(slave.get_real(seen)), np.array(there.get_real(seen))
    slave.set_real([0, 1, 2, 3], there.get_real([0, 1, 2, 3]))
    slave._reals[7:20], slave._channels = there._reals[7:20], there._channels
    slave._derive(0.1, 0.1)
    found = np.array(slave.get_real(seen))
    names = np.array([QuadrotorPlant.variables[i].name for i in seen])
    assert [*names[np.abs(found - expected) > 1e-12]] == []
    assert [*names[found == before]] == [], "expected a value that moves: observe of plant_fmu/observed.py sets it"


def test_the_length_of_the_attitude_returns_to_one_and_moves_no_force() -> None:
    slave = plant(**MOVING)
    before = np.array(slave._derive(0.0, 0.0))
    for factor in (1.01, 0.98):
        reals = list(slave._reals)
        slave._reals[13:17] = [factor * q for q in reals[13:17]]
        q = np.array(slave._reals[13:17])
        rates = np.array(slave._derive(0.0, 0.0))
        assert 2.0 * q @ rates[6:10] == pytest.approx(2.0 * RECALL * (1.0 - q @ q) * (q @ q), rel=1e-9)
        assert rates[3:6] == pytest.approx(before[3:6], abs=1e-12)
        slave._reals[:] = reals


def test_motors_with_a_lag_in_one_direction_alone_are_refused_by_name() -> None:
    with pytest.raises(
        FmuError, match=r"motor.time_constant.up = 0.0: expected a lag where motor.time_constant.down = "
    ):
        plant(**{"motor.thrust_max": 6.0, "motor.time_constant.down": 0.07})._derive(0.0, 0.0)


@pytest.mark.parametrize("name", NATIVES)
def test_a_solver_of_fmpy_flies_what_steps_fly(name: str) -> None:
    outputs, path = [*MEASUREMENT, "tilt", "acceleration.z", "der(velocity.z)", "channels.a"], str(fmus.locate(name))

    def flown(kind: str, **how: Any) -> Any:
        return fmpy.simulate_fmu(
            path, fmi_type=kind, stop_time=2.0, output_interval=0.01, output=outputs, start_values=FLIGHT, **how
        )

    steps, solved, rough = (
        flown("CoSimulation"),
        flown("ModelExchange", solver="CVode", relative_tolerance=1e-9),
        flown("ModelExchange", solver="Euler"),
    )
    assert [*solved[-1]] == pytest.approx([*steps[-1]], abs=1e-6)
    assert [*rough[-1]] == pytest.approx([*steps[-1]], abs=0.3)
    assert steps["der(velocity.z)"] == pytest.approx(steps["acceleration.z"], abs=1e-12)
    length = np.sqrt(sum(solved[f"quaternion.{axis}"] ** 2 for axis in "xyzw"))
    assert length == pytest.approx(1.0, abs=1e-7)


def system(name: str, **keys: Any) -> dict[str, Any]:
    """The plant under the paper's controller."""
    measured = [x for x in MEASUREMENT if not x.startswith("reference")]
    command = ("thrust", "torque.x", "torque.y", "torque.z")
    drop = {"payload.mass": 0.2, "payload.drop_time": 1.2345}
    return {
        "stop_time": 2.0,
        "components": {
            "plant": {"fmu": name, "step": 0.01, "parameters": drop, **keys},
            "law": {"fmu": "native/UnifiedController", "sampling": {"period": 0.01, "jitter": 0.002}},
        },
        "connections": [
            {"from": [f"plant.{x}" for x in measured], "to": [f"law.{x}" for x in measured]},
            {"from": [f"law.{x}" for x in command], "to": [f"plant.{x}" for x in command], "delay": 0.003},
        ],
    }  # fmt: skip


def test_a_flight_by_both_engines_has_the_columns_of_steps_and_the_drop_is_an_event(tmp_path: Path) -> None:
    exchange = {"interface": "model-exchange", "tolerance": 1e-10}
    steps = quadcosim.run(system(NATIVES[0], step=0.001), in_process=True)
    for name in NATIVES:
        rows = [
            quadcosim.run(system(name, **exchange), in_process=True, engine=engine) for engine in ("python", "compiled")
        ]
        assert rows[0].rows.tobytes() == rows[1].rows.tobytes()
        assert [x.time for x in rows[0].events if x.kind == "event"] == [1234500000]
        assert rows[0].columns == steps.columns
        for of in ("position.x", "quaternion.w", "tilt"):
            assert rows[0].signals[f"plant.{of}"][-1] == pytest.approx(steps.signals[f"plant.{of}"][-1], abs=1e-4)
    assert fly_until(system(name, **exchange), 0.77, tmp_path / "paused", in_process=True) is None
    assert resume(tmp_path / "paused", in_process=True).rows.tobytes() == rows[1].rows.tobytes()


def test_calls_in_the_wrong_mode_and_states_that_are_not_finite_are_refused(tmp_path: Path) -> None:
    path = str(fmus.locate(NATIVES[0]))
    fmpy.extract(path, str(tmp_path))
    description = fmpy.read_model_description(path)
    said: list[str] = []
    it = FMU2Model(
        guid=description.guid, unzipDirectory=str(tmp_path), modelIdentifier="QuadrotorPlant", instanceName="it"
    )
    callbacks = fmpy.fmi2.fmi2CallbackFunctions()
    log = lambda environment, instance, status, category, message: said.append(message.decode())  # noqa: E731
    callbacks.logger = fmpy.fmi2.fmi2CallbackLoggerTYPE(log)
    callbacks.allocateMemory = fmpy.fmi2.fmi2CallbackAllocateMemoryTYPE(fmpy.calloc)
    callbacks.freeMemory = fmpy.fmi2.fmi2CallbackFreeMemoryTYPE(fmpy.free)
    it.instantiate(callbacks=callbacks)
    it.setupExperiment()
    it.enterInitializationMode()
    it.exitInitializationMode()
    it.enterContinuousTimeMode()
    count = len(description.derivatives)
    values = (fmpy.fmi2.fmi2Real * count)()
    it.getContinuousStates(values, count)
    values[0] = math.nan
    with pytest.raises(Exception, match=r"fmi2SetContinuousStates.*2 \(discard\)"):
        it.setContinuousStates(values, count)
    values[0] = 0.25
    it.setContinuousStates(values, count)
    assert it.getReal([description.derivatives[0].variable.derivative.valueReference]) == [0.25]
    with pytest.raises(Exception, match=r"fmi2EnterContinuousTimeMode.*3 \(error\)"):
        it.enterContinuousTimeMode()
    assert said[-1] == "fmi2EnterContinuousTimeMode: not allowed in this mode"
    it.freeInstance()
