"""Steps of inputs of closed loops: against recursions by hand, python-control and runs, and what is refused."""

import json
import math
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from orchestration.foundation.basics.simulator import Floats
from orchestration.systems.system.model import System
from orchestration.systems.system.paths import changed
from orchestration.theory.stability.step import sizes_of
from quadcosim import StepResponse, UsageError, run, step_response
from tests.commands import Main
from tests.examples.common import native_example as example
from tests.places import EXAMPLES

MOTOR = EXAMPLES / "dc_motor" / "system.toml"
GAIN = 3.0 - math.sqrt(3.0)
"""Gain of the feedback of the integrator"""


@cache
def system_of(name: str) -> System:
    return example(name)


def at_whole_seconds(found: StepResponse) -> Floats:
    return found.response[np.abs(found.times - np.round(found.times)) < 1e-9]


def test_a_disturbance_of_a_late_integrator_moves_it_as_a_recursion_by_hand() -> None:
    """x' = w - K x_k from d after sample k on: x_(k+1) = x_k + h w - d K x_(k-1) - (h - d) K x_k."""
    late = changed(system_of("minimum_variance"), {"connections.command.delay": 0.3})
    found = step_response(late, to="noise", of="plant.x")
    x, before = [0.0], 0.0
    for _ in range(50):
        x.append(x[-1] + 1.0 - 0.3 * GAIN * before - 0.7 * GAIN * x[-1])
        before = x[-2]
    known = at_whole_seconds(found)
    assert known[:51] == pytest.approx(x[: len(known)], abs=1e-7)
    at = np.searchsorted(found.times, [0.2, 1.2, 1.5], side="left")
    assert found.response[at] == pytest.approx([0.2, 1.2, 1.3 + 0.2 * (1.0 - GAIN)], abs=1e-7)  # between samples, too
    assert found.steady_state == pytest.approx(1.0 / GAIN, rel=1e-6)
    assert found.remaining_error is None
    assert (found.peak, found.peak_time) == (pytest.approx(max(found.response)), pytest.approx(1.3))
    assert found.overshoot == pytest.approx(100.0 * (1.3 * GAIN - 1.0), rel=1e-6)


def test_what_is_added_to_a_connected_input_is_a_step_of_python_control() -> None:
    """1 added to the measured state: it goes to -1 by -K / (z - 1 + K)."""
    control = pytest.importorskip("control")
    found = step_response(system_of("minimum_variance"), to="controller.x", of="plant.x")
    known = at_whole_seconds(found)
    by_hand = control.feedback(control.ss([[1.0]], [[1.0]], [[GAIN]], [[0.0]], 1.0), 1.0)
    times = np.arange(len(known), dtype=float)
    assert -known == pytest.approx(control.step_response(by_hand, times).outputs, abs=1e-7)
    info = control.step_info(by_hand, T=times)
    assert found.overshoot == pytest.approx(info["Overshoot"], abs=1e-4)
    assert found.steady_state == pytest.approx(-1.0, rel=1e-6)
    sent = step_response(system_of("minimum_variance"), to="controller.x", of="controller.u")
    assert (sent.response[0], sent.steady_state) == (pytest.approx(-GAIN), 0.0)
    assert sent.verdict.startswith("a step of 1 of controller.x moves controller.u by -1.268 1/s after 0 s, and back: ")


def test_what_first_goes_the_wrong_way_has_the_undershoot_of_python_control() -> None:
    """A cart under a pendulum, or any loop with a zero outside the unit circle; rounding is no undershoot."""
    control = pytest.importorskip("control")
    system = control.tf([-0.1, 0.15], [1.0, -1.6, 0.65], 1.0)
    times = np.arange(200.0)
    response, info = control.step_response(system, times).outputs, control.step_info(system, T=times)
    for sign in (1.0, -1.0):
        sizes = sizes_of(times, sign * response, sign * float(system.dcgain()), has_value=True)
        assert (sizes.undershoot, sizes.overshoot) == pytest.approx((info["Undershoot"], info["Overshoot"]), rel=1e-6)
        assert sizes.shoots == [f"undershoot {info['Undershoot']:.3g} %", f"overshoot {info['Overshoot']:.3g} %"]
    rounded = sizes_of(times, np.where(times > 0.0, 1.0, -1e-9), 1.0, has_value=True)
    assert (rounded.undershoot, rounded.shoots) == (0.0, ["overshoot 0 %"])


def test_a_step_of_a_reference_is_that_of_a_run_of_a_linear_loop_of_two_rates(main: Main, tmp_path: Path) -> None:
    """A motor whose current is controlled at five times the rate of its speed, in one code, from rest."""
    motor = system_of("dc_motor")
    signals = run(motor).signals
    for output in ("motor.speed", "controller.voltage"):
        found = step_response(motor, to="wanted", of=output)
        of_run = dict(zip(np.round(signals["time"] * 1e7), signals[output] / 100.0))
        both = [(of_run[t], y) for t, y in zip(np.round(found.times * 1e7), found.response) if t in of_run]
        assert len(both) > 1000
        assert np.diff(both) == pytest.approx(0.0, abs=1e-9)
    document = json.loads(
        main("step", MOTOR, "--to", "wanted", "--of", "motor.speed", "--json", "--out", tmp_path).stdout
    )
    assert document["verdict"].startswith("motor.speed follows a step of 1 rad/s of wanted: rises in 5.6 ms, overshoot")
    assert document["remaining_error"] == 0.0
    found = step_response(motor, to="wanted", of="motor.speed")
    assert (document["times"], document["response"]) == (found.times.tolist(), found.response.tolist())
    assert (tmp_path / "step_wanted_motor_speed.png").read_bytes().startswith(b"\x89PNG")


def test_a_load_that_no_connection_brings_is_led_back() -> None:
    found = step_response(system_of("dc_motor"), to="motor.load", of="motor.speed")
    assert (found.rise_time, found.undershoot, found.overshoot) == (None, None, None)
    assert found.steady_state == 0.0
    within = np.abs(found.response[found.times >= found.settling_time])
    assert within.max() <= 0.02 * abs(found.peak) < np.abs(found.response).max()
    (axes,) = found.plot()["step"].axes
    assert axes.get_title() == "after a step of 1 N·m of motor.load"


def test_what_has_no_response_is_refused_in_words() -> None:
    integrator = system_of("minimum_variance")
    with pytest.raises(UsageError, match=r"plant\.v: no source and no Real input; did you mean plant\.w"):
        step_response(integrator, to="plant.v", of="plant.x")
    with pytest.raises(UsageError, match=r"plant\.w: no Real output; did you mean plant\.x"):
        step_response(integrator, to="noise", of="plant.w")
    unstable = changed(integrator, {"components.controller.parameters.gain": 2.1})
    with pytest.raises(UsageError, match=r"a loop that settles; from noise to plant\.x the spectral radius is"):
        step_response(unstable, to="noise", of="plant.x")


def test_step_of_the_command_line_takes_both_names_or_a_component(main: Main) -> None:
    for flags in (["--to", "wanted"], ["--to", "wanted", "--of", "motor.speed", "--component", "controller"]):
        told = main("step", MOTOR, *flags, code=2)
        assert "expected --to and --of together, without --component" in told.stderr
