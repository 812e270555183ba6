"""Loops cut open about their operating points: against theory, closed again, and what is refused."""

import dataclasses
import json
import math
import sys
from typing import Any

import numpy as np
import pytest

import quadcosim
from orchestration.components.fmi.reuse import Instances
from orchestration.foundation.basics.unit_algebra import time_text
from orchestration.systems.system.model import System
from orchestration.systems.system.paths import changed
from orchestration.theory.stability.period_map import growth_of_loop
from orchestration.theory.stability.poles import in_words
from orchestration.theory.stability.state_space import reduced
from quadcosim import Linearised, QuadcosimError, StateSpace, Timing, UsageError, bode, linearise
from tests.commands import Main
from tests.examples.common import native_example as example
from tests.native import native
from tests.orchestration.experiments.studies.test_systems import DELAY, PERIOD
from tests.places import EXAMPLES


@pytest.fixture(scope="module")
def system() -> System:
    return dataclasses.replace(example("double_integrator"), stop_time=20.0)


def responses(of: StateSpace, count: int) -> np.ndarray:
    """The outputs at the samples 1 to `count` after a unit command at sample 0, shape (count, outputs, inputs)."""
    state, found = of.B, []
    for _ in range(count):
        found.append(of.C @ state)
        state = of.A @ state
    return np.array(found)


def closed(loop: Linearised) -> np.ndarray:
    """The matrix of both halves, each the other's input and output."""
    rest, law = loop.rest, loop.component
    assert (rest.inputs, rest.outputs) == (law.outputs, law.inputs)
    assert not rest.D.any()
    return np.block([[rest.A + rest.B @ law.D @ rest.C, rest.B @ law.C], [law.B @ rest.C, law.A]])


@pytest.mark.parametrize(("period", "delay", "states"), [(0.5, 0.0, 2), (0.5, 0.3, 3), (0.05, 0.13, 5)])
def test_the_rest_of_a_loop_is_the_plant_behind_hold_and_delay(
    system: System, period: float, delay: float, states: int
) -> None:
    """A command at 0 pushes from `delay` for a period: what has gone by is t, and as much of it as is in the push."""
    rest = linearise(changed(system, {PERIOD: period, DELAY: delay})).rest
    t = period * np.arange(1, 41)
    pushed, since = np.clip(t - delay, 0.0, period), np.maximum(t - delay - period, 0.0)
    expected = {"x": pushed * (pushed / 2.0 + since), "v": pushed}
    assert (len(rest.A), rest.dt) == (states, period)
    for name, found in zip(rest.outputs, responses(rest, 40)[:, :, 0].T):
        assert found == pytest.approx(expected[name], rel=1e-6, abs=1e-8)


@pytest.mark.parametrize(
    "changes",
    [
        {"connections.command.hold": "first", DELAY: 0.1},
        {"connections.measurement.delay": 0.13, "connections.command.order": "jacobi"},
        {"components.controller.sampling.offset": 0.2, "components.controller.sampling.clock_ratio": 1.25},
    ],
)
def test_closed_again_it_is_the_loop_of_the_local_limit_under_any_timing(
    system: System, changes: dict[str, Any]
) -> None:
    varied, instances = changed(system, {PERIOD: 0.4, **changes}), Instances()
    loop = linearise(varied)
    radius = np.abs(np.linalg.eigvals(closed(loop))).max()
    assert math.log(radius) / loop.rest.dt == pytest.approx(growth_of_loop(varied, instances), abs=1e-7)
    instances.close()


def test_the_servo_closed_again_has_the_spectral_radius_of_theory() -> None:
    """0.9324 at a delay of 2 ms, to its four digits; the controller has two states."""
    loop = linearise(changed(example("dc_servo"), {"connections.command.delay": 0.002}))
    assert np.abs(np.linalg.eigvals(closed(loop))).max() == pytest.approx(0.9324, abs=5e-5)
    assert len(loop.component.A) == 2


def test_a_vehicle_that_hovers_has_twelve_states_however_fast_it_is_sampled() -> None:
    """A torque about y tilts, and so accelerates by g: x is -g h t³/(6 J) long after a sample of it."""
    loop = linearise(native(timing=Timing(period=0.002)))
    rest, point = loop.rest, loop.operating_point
    moved = responses(rest, 500)[-1, rest.outputs.index("position.x"), rest.inputs.index("torque.y")]
    middle = 1.0 - 0.001  # of the push
    inertia = quadcosim.read_model("fmus/QuadrotorPlant.fmu").variables["inertia.yy"].start
    assert inertia is not None
    assert len(rest.A) == 12
    assert point["plant.thrust"] == point["controller.thrust"] == pytest.approx(9.81)
    ends = {f"controller.{name}": float(name == "quaternion.w") for name in rest.outputs}
    assert {end: point[end] for end in ends} == pytest.approx(ends)
    assert moved == pytest.approx(-9.81 * 0.002 * middle**3 / (6.0 * float(inertia)), rel=1e-5)


def test_what_no_input_moves_and_no_output_shows_is_left_out() -> None:
    """Of four states one is moved and shown, one only moved, one only shown, one neither; it runs away, too."""
    A, B, C = reduced(np.diag([2.0, 0.5, 0.4, 0.3]), np.array([[1.0], [1.0], [0.0], [0.0]]), np.array([[3.0, 0, 1, 0]]))
    assert (A.item(), (C @ B).item()) == (pytest.approx(2.0), pytest.approx(3.0))
    assert reduced(np.eye(2), np.zeros((2, 1)), np.ones((1, 2)))[0].shape == (0, 0)


def test_a_fast_state_beside_a_growing_one_is_left_out_only_if_the_response_stays_right() -> None:
    A, B = np.diag([1.1, 1.0, 0.9, 0.15]), np.ones((4, 1))
    for share, states in ((1e-7, 4), (1e-8, 3)):
        assert len(reduced(A, B, np.array([[1.0, -2.0, 1.0, share]]))[0]) == states


def test_a_delay_over_more_samples_than_are_tried_first_keeps_all_its_states() -> None:
    """A slow, badly damped plant behind a delay of 70 samples: no fewer states have its impulse response."""
    late = 70
    A = np.diag(np.ones(late + 1), -1)
    A[late:, late:] = [[1.0, 0.01], [-0.02, 0.98]]
    A[late, late - 1], A[late + 1, late - 1] = 0.0, 0.01
    B, C = np.eye(late + 2)[:, :1], np.eye(late + 2)[late : late + 1]
    responses = []
    for a, b, c in ((A, B, C), reduced(A, B, C)):
        assert len(a) == late + 2
        responses.append([(c @ np.linalg.matrix_power(a, k) @ b).item() for k in (late, late + 2, 100, 500)])
    assert responses[1] == pytest.approx(responses[0], rel=1e-8, abs=1e-12)


@pytest.mark.parametrize(
    ("name", "component", "expected"),
    [
        ("double_integrator", "plant", r"^component: plant is not sampled: expected one of controller$"),
        ("double_integrator", "contoller", r"^component: contoller: did you mean controller\?"),
        ("four_components", None, r"of the 3 that are sampled: sensor, controller, engine$"),
    ],
)  # fmt: skip
def test_a_component_at_which_no_loop_can_be_cut_open_is_refused_before_anything_is_loaded(
    monkeypatch: pytest.MonkeyPatch, name: str, component: str | None, expected: str
) -> None:
    monkeypatch.setattr("orchestration.theory.stability.linearise.single_run_execution", None)
    for of_loop in (linearise, bode) if component else (linearise,):  # bode takes several
        with pytest.raises(UsageError, match=expected):
            of_loop(example(name), component)


def test_a_linearised_loop_is_a_system_of_python_control_with_its_names(system: System) -> None:
    control = pytest.importorskip("control")
    rest = linearise(changed(system, {PERIOD: 0.5})).rest
    found = dataclasses.replace(rest, inputs=("torque.x",)).to_control()
    assert (found.input_labels, found.output_labels, found.dt) == (["torque_x"], ["x", "v"], 0.5)
    z = np.exp(0.3j)
    assert found(z)[1, 0] == pytest.approx(control.tf([0.5], [1, -1], 0.5)(z), rel=1e-6)


def test_without_python_control_one_line_names_the_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "control", None)
    none = np.zeros((0, 0))
    empty = StateSpace(A=none, B=none, C=none, D=none, dt=1.0, inputs=(), outputs=())
    with pytest.raises(
        QuadcosimError, match=r"^control is not installed; this needs: pip install 'quadcosim\[control\]"
    ):
        empty.to_control()


def test_the_command_writes_the_matrices_that_python_has(main: Main, monkeypatch: pytest.MonkeyPatch) -> None:
    file = EXAMPLES / "double_integrator" / "system.toml"
    loop = linearise(example("double_integrator"))
    document = json.loads(main("linearise", file, "--native", "--json").stdout)
    assert document["name"] == loop.name
    for half, found in (("component", loop.component), ("rest", loop.rest)):
        written = document[half]
        assert {name: written[name] for name in "ABCD"} == {name: getattr(found, name).tolist() for name in "ABCD"}
        assert (written["dt"], written["inputs"], written["outputs"]) == (found.dt, [*found.inputs], [*found.outputs])
    assert loop.radius == pytest.approx(np.abs(np.linalg.eigvals(closed(loop))).max(), rel=1e-9)
    lines = main("linearise", file, "--native").stdout.splitlines()
    assert lines[0].startswith(f"stable: spectral radius {loop.radius:.4g}, sampled every ")
    assert lines[2].endswith(f"{len(loop.rest.A)} states, every {time_text(loop.rest.dt)}")
    assert "z = 0" not in lines[-1]
    shorter = dataclasses.replace(loop, poles=loop.poles[:1])
    monkeypatch.setattr("orchestration.theory.stability.linearise.linearise", lambda *_: shorter)
    lines = main("linearise", file, "--native").stdout.splitlines()
    assert lines[-1] == "poles at z = 0 are not listed: they are of what a period forgets"


def test_a_double_pole_that_rounding_splits_is_real_in_words_and_a_slow_oscillation_is_none() -> None:
    assert in_words(0.9966 + 2e-8j) == "0.9966"
    assert in_words(0.99999 - 3.2e-5j) == "1.0000 ± 3.2e-05j"
    assert in_words(0.5 + 0.25j) == "0.5000 ± 0.2500j"
