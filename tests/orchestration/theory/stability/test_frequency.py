"""Margins and steps of sampled loops: against python-control, against the loop made as late, and what is refused."""

import dataclasses
import json
import math
from functools import cache
from pathlib import Path
from typing import Any, cast

import numpy as np
import pytest
from matplotlib.text import Annotation

from orchestration.systems.system.model import System
from orchestration.systems.system.paths import changed
from orchestration.theory.stability import frequency
from orchestration.theory.stability import linearise as linearise_module
from orchestration.theory.stability.delay_margin import Late, LateCommand, delay_margin, jumps_of
from orchestration.theory.stability.frequency import delayed, expect_decided, stepped_couplings
from orchestration.theory.stability.lifted_margins import gain_margins, lifted_gains, phase_margin
from orchestration.theory.stability.loop_halves import closed, sensitivity_of
from orchestration.theory.stability.loop_margins import GainMargin
from orchestration.theory.stability.resolvent import Resolvent
from quadcosim import Bode, Bodes, Linearised, Sampling, StateSpace, Step, UsageError, bode, linearise, locus, step
from tests.commands import Main
from tests.examples.common import native_example as example
from tests.extent import sample
from tests.orchestration.experiments.studies.test_systems import DELAY
from tests.places import EXAMPLES

NAMES = ("dc_servo", "lqg")
"""Loops of one command: one has a law that is stable alone, one an unstable plant"""


@cache
def system_of(name: str) -> System:
    return example(name)


@cache
def bode_of(name: str) -> Bode:
    return bode(system_of(name), "controller")


@cache
def step_of(name: str) -> Step:
    return step(system_of(name))


@cache
def loop_gain(name: str) -> Any:
    """The loop gain as a system of python-control."""
    control = pytest.importorskip("control")
    loop = linearise(system_of(name))
    return control.ss(-loop.component.to_control() * loop.rest.to_control())


@pytest.mark.parametrize("name", sample(NAMES, 1))
def test_margins_are_those_of_python_control(name: str) -> None:
    control = pytest.importorskip("control")
    gain = control.stability_margins(loop_gain(name))[0]
    # Its roots of polynomials lose digits that its search along the response has.
    _, phase, distance, _, crossover = control.stability_margins(loop_gain(name), method="frd")[:5]
    found = bode_of(name)
    (loop,) = found.loops
    assert found.stable
    assert loop.gain_margin == pytest.approx(gain, rel=1e-4)
    # All factors that turn the loop gain into -1, of which it has those that end stability: a loop of them is stable
    # in between.
    every, _, _, at_phase, *_ = control.stability_margins(loop_gain(name), returnall=True)
    nearest = [max(every[every < 1.0]), min(every[every > 1.0])]
    assert [one.factor for one in loop.gain_margins] == pytest.approx(nearest, rel=1e-4)
    at = [at_phase[list(every).index(factor)] for factor in nearest]
    assert [one.frequency for one in loop.gain_margins] == pytest.approx(at, rel=1e-3, abs=1e-3)
    assert (loop.phase_margin, loop.crossover) == (pytest.approx(phase, rel=1e-6), pytest.approx(crossover, rel=1e-6))
    assert loop.sensitivity_peak == found.sensitivity_peak == pytest.approx(1.0 / distance, rel=1e-4)
    at = loop_gain(name)(np.exp(1j * np.array([loop.crossover, 1.0]) * found.dt))
    assert abs(at[0]) == pytest.approx(1.0, rel=1e-6)
    assert 180.0 + math.degrees(np.angle(at[0])) == pytest.approx(loop.phase_margin, abs=1e-4)
    assert np.interp(1.0, found.frequencies, np.abs(found.gains[0])) == pytest.approx(abs(at[1]), rel=1e-4)


@pytest.mark.parametrize("name", NAMES)
def test_poles_with_their_damping_are_those_of_python_control(name: str) -> None:
    control = pytest.importorskip("control")
    frequency, damping, poles = control.damp(control.feedback(loop_gain(name), 1.0), doprint=False)
    found, order = linearise(system_of(name)).poles, np.argsort(-np.abs(poles), kind="stable")
    assert [[one.frequency, one.damping] for one in found] == pytest.approx(
        np.column_stack([frequency, damping])[order], rel=1e-5
    )
    assert sorted(one.z.imag for one in found) == pytest.approx(sorted(poles.imag))


@pytest.mark.parametrize("name", NAMES)
def test_a_step_is_that_of_python_control(name: str) -> None:
    control = pytest.importorskip("control")
    closed = control.feedback(loop_gain(name), 1.0)
    known, found = control.step_info(closed, T=step_of(name).times), step_of(name)
    (loop,) = found.loops
    assert loop == found.slowest
    assert loop.steady_state == pytest.approx(float(np.real(closed.dcgain())), rel=1e-6)
    assert (loop.rise_time, loop.settling_time) == (
        pytest.approx(known["RiseTime"], abs=1e-9), pytest.approx(known["SettlingTime"], abs=1e-9),
    )  # fmt: skip
    assert loop.overshoot == pytest.approx(known["Overshoot"], abs=0.01)
    assert found.responses[0] == pytest.approx(control.step_response(closed, found.times).outputs, rel=1e-6, abs=1e-9)


@pytest.mark.parametrize("name", NAMES)
def test_a_loop_that_is_late_by_its_delay_margin_is_between_stable_and_unstable(name: str) -> None:
    """Also by a part of a period: 11.497 ms are 1.92 periods of the servo."""
    (loop,) = bode_of(name).loops
    assert loop.delay_margin is not None
    assert (loop.input.rpartition(".")[2], loop.output) == ("u", "controller.u")
    sooner, later = (
        linearise(delayed(system_of(name), "controller", share * loop.delay_margin)).radius for share in (0.999, 1.001)
    )
    assert sooner < 1.0 < later


@pytest.mark.parametrize(("period", "longest"), [(0.006, 0.016), (0.008, 0.012)])
def test_a_delay_to_a_sampled_receiver_acts_where_a_message_misses_its_sample(period: float, longest: float) -> None:
    """Also where rates meet: the margin is the last delay before a jump, as the loop made as late has it."""
    one = system_of("dc_servo")
    servo = dataclasses.replace(one.components["servo"], step=None, sampling=Sampling(period=period))
    sampled = dataclasses.replace(one, components={**one.components, "servo": servo})
    (loop,) = bode(sampled, "controller").loops
    assert (loop.delay_margin, loop.delay_reason) == (longest, "")
    late = [delayed(sampled, "controller", delay) for delay in (longest, longest + 1e-9)]
    before, after = (linearise(each, "controller").radius for each in late)
    assert before < 1.0 < after
    found = locus(sampled, DELAY, first=0.0, last=0.03, count=3)
    assert [one.value for one in found.crossings] == [pytest.approx(longest + 0.002, abs=1e-12)]
    (crossing,) = found.crossings
    assert abs(crossing.z) == pytest.approx(after, rel=1e-9)  # that which has jumped out
    moved = np.diff(found.curve)
    assert np.abs(moved[1, moved[0] > 2e-9]).max() < 1e-9  # level between jumps


def test_a_loop_that_is_unstable_for_a_while_between_two_jumps_has_the_margin_before(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A stub of growth, with delays of 11 to 12 ms, between the parts of samples."""
    one = system_of("dc_servo")
    servo = dataclasses.replace(one.components["servo"], step=None, sampling=Sampling(period=0.01, offset=0.003))
    other = dataclasses.replace(one.components["controller"], sampling=Sampling(period=0.02))
    jumps = jumps_of(dataclasses.replace(one, components={"controller": other, "servo": servo}), "controller")
    assert jumps == (0.001, 0.011)
    monkeypatch.setattr(LateCommand, "ends_stability", lambda command, part: True)
    monkeypatch.setattr(LateCommand, "tolerated", lambda command, delay: 0.01)
    monkeypatch.setattr(LateCommand, "growth", lambda command, delay: 1.0 if 0.011 < delay < 0.012 else -1.0)
    loop = dataclasses.replace(linearise(one), samples=2)
    loop = dataclasses.replace(loop, rest=dataclasses.replace(loop.rest, dt=0.04))
    assert delay_margin(loop, 0, np.zeros(0), Late(rest=lambda part: cast(Any, part), jumps=jumps)) == 0.011


def test_components_in_continuous_time_that_exchange_at_their_steps_are_named() -> None:
    one = system_of("dc_servo")
    coarse = dataclasses.replace(one.components["servo"], step=0.004)
    to = dataclasses.replace(one.connections[0], name="coupling", start=("servo.angle",), end=("coarse.u",))
    parts = {**one.components, "coarse": coarse}
    coupled = dataclasses.replace(one, components=parts, connections=(*one.connections, to))
    assert not stepped_couplings(one)
    assert stepped_couplings(coupled) == [("servo", "coarse", 0.004)]


def test_a_delay_margin_that_is_not_found_leaves_the_other_margins(monkeypatch: pytest.MonkeyPatch) -> None:
    def fails(*_: object) -> float:
        raise UsageError("the loop is stable with all delays")

    monkeypatch.setattr(frequency, "delay_margin", fails)
    monkeypatch.setattr(linearise_module, "isolated_call", lambda _, call, *args: call(*args))
    found = bode(system_of("dc_servo"))
    (loop,) = found.loops
    assert (loop.delay_margin, loop.delay_reason) == (None, "the loop is stable with all delays")
    assert found.verdict.endswith("phase margin 33.7°, delay margin not known (small deviations)")


def test_a_loop_of_one_command_has_the_others_closed() -> None:
    """The sensitivity of a command is the entry of (I - C G)^-1 on the diagonal."""
    random = np.random.default_rng(5)

    def half(states: int, inputs: int, outputs: int, D: float) -> StateSpace:
        A, B, C = (0.3 * random.normal(size=size) for size in ((states, states), (states, inputs), (outputs, states)))
        return StateSpace(
            A=A, B=B, C=C, D=D * random.normal(size=(outputs, inputs)), dt=0.1, inputs=("",) * inputs,
            outputs=("",) * outputs,
        )  # fmt: skip

    law, others = half(2, 2, 3, 0.5), half(4, 3, 2, 0.0)
    loop = Linearised(name="law", component=law, rest=others, operating_point={}, radius=0.5, poles=())
    z = np.exp(0.7j)

    def at(of: StateSpace) -> np.ndarray:
        return np.asarray(of.C @ np.linalg.solve(z * np.eye(len(of.A)) - of.A, of.B) + of.D)

    sensitivity = np.diag(np.linalg.inv(np.eye(3) - at(loop.component) @ at(loop.rest)))
    assert [sensitivity_of(loop, i)(np.array([7.0])).item() for i in range(3)] == pytest.approx(sensitivity, rel=1e-9)


@pytest.mark.parametrize("states", [0, 1, 2, 9])
def test_the_answer_at_many_frequencies_is_that_of_a_solve_at_each(states: int) -> None:
    """Of a map that Householder leaves alone in a column, with states in units far apart, and a multiple pole of 0."""
    random, units = np.random.default_rng(2), np.geomspace(1.0, 1e6, states)
    A, B, C = (random.normal(size=size) for size in ((states, states), (states, 2), (3, states)))
    A[1:, :1] = 0.0
    A[states // 2 :, 3:] = 0.0
    A, B, C = units[:, None] * A / units, units[:, None] * B, C / units
    z = 3.0 * np.exp(1j * np.linspace(0.0, np.pi, 300))
    expected = C @ np.linalg.solve(z[:, None, None] * np.eye(states) - A, B.astype(complex)[None])
    assert Resolvent.of(A, B, C).at(z) == pytest.approx(expected, rel=1e-10, abs=1e-12)


def test_beside_whole_turns_in_a_period_of_five_samples_gains_and_sensitivity_are_those_of_one() -> None:
    """Four integrators with feedback of their state, all samples with the same gains: rounding has no say there."""
    samples, dt = 5, 0.004
    A = np.array(
        [[1.0, dt, dt**2 / 2, dt**3 / 6], [0.0, 1.0, dt, dt**2 / 2], [0.0, 0.0, 1.0, dt], [0.0, 0.0, 0.0, 1.0]]
    )
    B = np.array([[dt**4 / 24], [dt**3 / 6], [dt**2 / 2], [dt]])
    gains = np.array([[960.0, 1280.0, 560.0, 50.0]])  # of poles of -2, -4, -4 and -40 1/s, about
    powers = [np.linalg.matrix_power(A, k) for k in range(samples + 1)]
    direct = np.zeros((4 * samples, samples))
    for later, sooner in zip(*np.tril_indices(samples, -1)):
        direct[4 * later : 4 * later + 4, [sooner]] = powers[later - sooner - 1] @ B
    of_rest = StateSpace(
        A=powers[samples], B=np.hstack([power @ B for power in powers[samples - 1 :: -1]]),
        C=np.vstack(powers[:samples]), D=direct, dt=samples * dt, inputs=("",) * samples,
        outputs=("",) * 4 * samples,
    )  # fmt: skip
    law = StateSpace(
        A=np.zeros((0, 0)), B=np.zeros((0, 4 * samples)), C=np.zeros((samples, 0)),
        D=np.kron(np.eye(samples), -gains), dt=samples * dt, inputs=of_rest.outputs, outputs=of_rest.inputs,
    )  # fmt: skip
    loop = Linearised(
        name="law", component=law, rest=of_rest, operating_point={}, radius=0.5, poles=(), samples=samples
    )

    def gain(at: np.ndarray) -> np.ndarray:
        z = np.exp(1j * at * dt)[:, None, None]
        return np.asarray(gains @ np.linalg.solve(z * np.eye(4) - A, B[None]))[:, 0, 0]

    turn = 2.0 * np.pi / (samples * dt)
    beside = turn * np.array([1.0 - 1e-4, 1.0 + 1e-4, 1.0 + 1e-3, 2.0 + 1e-4])
    found, peak = lifted_gains(loop, 0, beside)
    assert found == pytest.approx(gain(beside), rel=1e-9)
    everywhere = np.add.outer(beside, turn * np.arange(samples)).ravel()
    assert peak == pytest.approx(np.abs(1.0 / (1.0 + gain(everywhere))).max(), rel=1e-9)
    (below, _), (above, at) = gain_margins(loop, 0, np.linspace(1.0, 0.5 * turn, 200))
    phase, crossover = phase_margin(loop, 0, np.linspace(1.0, 0.5 * turn, 200)) or (0.0, 0.0)
    assert at > 0.5 * turn
    assert gain(np.array([at]))[0] * above == pytest.approx(-1.0, abs=1e-6)
    assert np.exp(-1j * phase) * gain(np.array([crossover]))[0] == pytest.approx(-1.0, abs=1e-6)

    def radius(factor: complex) -> float:
        return float(np.abs(np.linalg.eigvals(A - factor * B @ gains)).max())

    assert max(radius(below * 1.001), radius(above * 0.999)) < 1.0 < min(radius(below * 0.999), radius(above * 1.001))
    turned = np.linspace(-phase, phase, 101)[1:-1]
    assert max(radius(np.exp(1j * one)) for one in turned) < 1.0 < radius(np.exp(-1.001j * phase))


def test_an_unstable_loop_has_no_margins_and_no_step() -> None:
    late = changed(system_of("dc_servo"), {DELAY: 0.02})
    found = bode(late, "controller")
    assert (found.stable, found.loops, found.sensitivity_peak) == (False, (), None)
    gain, *_ = found.plot()["bode"].axes  # its loop gain is drawn all the same
    assert gain.lines[0].get_ydata() == pytest.approx(20.0 * np.log10(np.abs(found.gains[0])))
    assert "unstable" in gain.get_title()
    rounded = dataclasses.replace(found, gains=np.where(found.frequencies > 30.0, 1e-19, found.gains))
    for axes in rounded.plot()["bode"].axes[:2]:  # what is zero but for rounding is not
        at, drawn = np.transpose(axes.lines[0].get_xydata())
        assert np.array_equal(np.isnan(drawn), at > 30.0)
    with pytest.raises(UsageError, match=r"^step: expected a stable loop; the spectral radius of this one is 1\.04"):
        step(late)


def test_a_loop_that_rounding_decides_is_refused_and_so_are_halves_that_are_not_the_loop() -> None:
    loop = linearise(system_of("dc_servo"))
    expect_decided(loop)
    with pytest.raises(UsageError, match="neither stable nor unstable"):
        expect_decided(dataclasses.replace(loop, radius=1.0 + 1e-9))
    law = dataclasses.replace(loop.component, C=10.0 * loop.component.C, D=10.0 * loop.component.D)
    with pytest.raises(UsageError, match="cannot be cut open at controller"):
        expect_decided(dataclasses.replace(loop, component=law))
    assert np.abs(np.linalg.eigvals(closed(loop).A)).max() == pytest.approx(loop.radius, rel=1e-9)


def test_a_loop_of_one_rate_has_the_same_margins_over_a_period_of_two() -> None:
    """A second component, which nothing is connected to, is sampled half as often."""
    one = system_of("dc_servo")
    other = dataclasses.replace(one.components["controller"], sampling=Sampling(period=0.012))
    both = dataclasses.replace(one, components={**one.components, "other": other})
    found, known = bode(both, "controller"), bode_of("dc_servo")
    assert (found.dt, found.samples, found.radius) == (known.dt, 2, pytest.approx(known.radius**2, rel=1e-9))
    assert "sampled every 6 ms, in a period of all rates of 12 ms: gain margins 0.169 and 3.25, phase" in found.verdict
    turns = found.frequencies * 0.012 / (2.0 * np.pi)  # at whole ones a position that is added up is infinite
    assert np.abs(turns[turns > 0.5] - 1.0).min() > 9e-5
    (loop,), (of_one,) = found.loops, known.loops
    for name in ("gain_margin", "phase_margin", "crossover", "sensitivity_peak"):
        assert getattr(loop, name) == pytest.approx(getattr(of_one, name), rel=1e-5), name
    assert loop.delay_margin == pytest.approx(of_one.delay_margin, abs=2e-8)
    for mine, theirs in zip(loop.gain_margins, of_one.gain_margins, strict=True):
        assert (mine.factor, mine.frequency) == pytest.approx((theirs.factor, theirs.frequency), rel=1e-5)
    for at in (1.0, 50.0, 300.0, 500.0):
        sizes = [np.interp(at, each.frequencies, np.abs(each.gains[0])) for each in (found, known)]
        assert sizes[0] == pytest.approx(sizes[1], rel=1e-3)
    top = GainMargin(factor=2.0, frequency=1.0001 * found.frequencies[-1])  # half the rate is left out of the curve
    drawn = dataclasses.replace(found, loops=(dataclasses.replace(loop, gain_margins=(top,)),)).plot()["bode"].axes[0]
    (label,) = (text for text in drawn.texts if text.get_text() == "× 2 (6.02 dB)")
    assert cast("Annotation", label).xy[0] <= drawn.get_xlim()[1]
    stepped, (of_step,) = step(both, "controller"), step_of("dc_servo").loops
    assert stepped.loops[0].overshoot == pytest.approx(of_step.overshoot, rel=1e-6)
    assert stepped.responses[0, :40] == pytest.approx(step_of("dc_servo").responses[0, :40], abs=1e-9)


@cache
def cascade() -> Bodes:
    """The loop of one servo, cut open before it and after it; it is sampled twice as often as its controller."""
    found = bode(in_cascade())
    assert isinstance(found, Bodes)
    return found


def in_cascade() -> System:
    one = system_of("dc_servo")
    servo = dataclasses.replace(one.components["servo"], step=None, sampling=Sampling(period=0.003))
    return dataclasses.replace(one, components={**one.components, "servo": servo})


def test_each_component_of_a_cascade_is_cut_open_and_one_loop_stands_the_same_factor_wherever_it_is_cut() -> None:
    found, alone = cascade(), bode(in_cascade(), "controller")
    assert found.components["controller"].loops == alone.loops
    after, before = found.loops
    assert [(one.output, one.input) for one in found.loops] == [
        ("servo.angle", "controller.angle"), ("controller.u", "servo.u"),
    ]  # fmt: skip
    assert [one.factor for one in after.gain_margins] == pytest.approx([x.factor for x in before.gain_margins])
    assert (after.phase_margin, after.crossover) == pytest.approx((before.phase_margin, before.crossover))
    assert found.verdict.startswith("stable, loops of servo every 3 ms, controller every 6 ms: gain margins 0.162 of ")
    assert found.verdict.endswith(", delay margin 12 ms of servo.angle (small deviations)")
    assert repr(found) == f"<Bodes: {found.verdict}>"
    for name, dt in (("servo", 0.003), ("controller", 0.006)):
        assert found.components[name].frequencies[-1] == pytest.approx(math.pi / dt, rel=0.01)
    unstable = {
        name: dataclasses.replace(one, stable=False, radius=2.0, loops=()) for name, one in found.components.items()
    }
    told = dataclasses.replace(found, components=unstable)
    assert (told.stable, told.loops, told.sensitivity_peak) == (False, (), None)
    assert told.verdict.startswith("unstable: spectral radius 2, loops of servo every 3 ms, controller every 6 ms: an")


def test_curves_of_a_cascade_are_named_each_up_to_half_its_own_rate() -> None:
    gain, *_ = cascade().plot()["bode"].axes
    curves = (at for line in gain.lines if len(at := np.asarray(line.get_xdata())) > 2)  # not lines of margins
    for at, text, (name, one) in zip(curves, gain.texts, cascade().components.items(), strict=True):
        assert at == pytest.approx(one.frequencies)
        assert text.get_text().startswith(f"{name}: ")
    assert gain.get_xlim()[1] == pytest.approx(cascade().components["servo"].frequencies[-1])
    wide = {
        name: dataclasses.replace(one, outputs=one.outputs * 5, loops=one.loops * 5, gains=np.tile(one.gains, (5, 1)))
        for name, one in cascade().components.items()
    }
    assert set(dataclasses.replace(cascade(), components=wide).plot()) == {"bode_servo", "bode_controller"}


def test_a_component_in_no_loop_is_left_out_and_refused_alone(capsys: pytest.CaptureFixture[str]) -> None:
    one = system_of("dc_servo")
    beside = dataclasses.replace(one, components={**one.components, "logger": one.components["controller"]})
    assert list(bode(beside).components) == ["controller"]
    assert "in no loop, left out: logger" in capsys.readouterr().err
    with pytest.raises(UsageError, match=r"^no loop goes through logger: expected"):
        bode(beside, "logger")


def test_a_component_of_too_many_samples_is_left_out_and_refused_alone(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(frequency, "MOST_SAMPLES", 1)
    assert list(bode(in_cascade()).components) == ["controller"]
    reason = "servo samples 2 times in the period of its loop, 6 ms; expected 1 times at most"
    assert f"left out: {reason}" in capsys.readouterr().err
    with pytest.raises(UsageError, match=f"^{reason}$"):
        bode(in_cascade(), "servo")


def test_the_command_prints_a_line_for_each_loop(main: Main, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(frequency, "bode", lambda *_: cascade())
    file = EXAMPLES / "dc_servo" / "system.toml"
    told = main("bode", file, "--out", tmp_path).stdout.splitlines()
    lines = [["servo.angle", "controller.angle"], ["controller.u", "servo.u"]]
    assert [line.split()[:2] for line in told[-2:]] == lines
    assert (tmp_path / "bode.png").exists()
    document = json.loads(main("bode", file, "--json").stdout)
    assert document.keys() == {"verdict", "stable", "sensitivity_peak", "loops", "components"}
    assert [[one["output"], one["input"]] for one in document["loops"]] == lines
    drawn = {"component", "dt", "outputs", "frequencies", "gains", "phases"}
    assert all(one.keys() == drawn for one in document["components"])
    assert {one["component"]: one["dt"] for one in document["components"]} == {"servo": 0.003, "controller": 0.006}


def test_the_commands_print_the_margins_first_and_draw(main: Main, tmp_path: Path) -> None:
    file = EXAMPLES / "dc_servo" / "system.toml"
    document = json.loads(main("bode", file, "--native", "--json", "--out", tmp_path).stdout)
    drawn = {"outputs", "frequencies", "gains", "phases"}
    assert document.keys() == {"verdict", "dt", "stable", "sensitivity_peak", "loops", *drawn}
    (gains,), (phases,), at = document["gains"], document["phases"], document["frequencies"]
    assert gains == np.abs(bode_of("dc_servo").gains[0]).tolist()
    loops = [dataclasses.asdict(loop) for loop in bode_of("dc_servo").loops]
    assert np.interp(loops[0]["crossover"], at, phases) == pytest.approx(loops[0]["phase_margin"] - 180.0, abs=0.1)
    assert document["loops"] == json.loads(json.dumps(loops))
    assert document["verdict"] == (
        "stable, sampled every 6 ms: gain margins 0.169 and 3.25, phase margin 33.7°, delay margin 11.5 ms "
        "(small deviations)"
    )
    told = main("step", file, "--native", "--json", "--out", tmp_path)
    assert "left out here: delay_jitter and loss of connections.command; expect includes them" in told.stderr
    stepped = json.loads(told.stdout)
    assert {"rise_time", "undershoot", "overshoot", "settling_time", "steady_state"} < stepped.keys()
    assert (stepped["times"], stepped["responses"]) == (
        step_of("dc_servo").times.tolist(),
        step_of("dc_servo").responses.tolist(),
    )
    assert stepped["verdict"].startswith("a step on controller.u settles in 300 ms, overshoot 54.7 %, 100 % taken back")
    of_floats = [dataclasses.replace(one, in_double=("a", "b")) for one in (step_of("dc_servo"), bode_of("dc_servo"))]
    assert all(one.verdict.endswith("tions, float code of a, b in double precision)") for one in of_floats)
    for name in ("bode", "step"):
        assert (tmp_path / f"{name}_controller.png").read_bytes().startswith(b"\x89PNG")
    (axes,) = step_of("dc_servo").plot()["step"].axes
    assert axes.get_ylabel() == "taken back of a step of 1 [V]"
    gain, phase, sensitivity, _ = bode_of("dc_servo").plot()["bode"].axes
    (loop,) = bode_of("dc_servo").loops
    dot = [[loop.crossover], [0.0]]  # where the gain is 1
    expected = [dot, *([[one.frequency] * 2, [0.0, -20.0 * np.log10(one.factor)]] for one in loop.gain_margins)]
    for line, ends in zip(gain.lines[1:], expected, strict=False):
        assert np.transpose(line.get_xydata()) == pytest.approx(np.array(ends))
    turned = [[loop.crossover] * 2, [-180.0, loop.phase_margin - 180.0]]
    assert np.transpose(phase.lines[1].get_xydata()) == pytest.approx(np.array(turned), rel=1e-4)
    assert [text.get_text() for axes in (gain, phase) for text in axes.texts] == [
        "× 0.169 (-15.4 dB)", "× 3.25 (10.3 dB)", "controller: u", "33.7°",
    ]  # fmt: skip
    peak = 20.0 * np.log10(loop.sensitivity_peak)
    assert np.max(np.asarray(sensitivity.lines[0].get_ydata())) == pytest.approx(peak)
    assert repr(bode_of("dc_servo")) == f"<Bode: {document['verdict']}>"
    assert repr(step_of("dc_servo")) == f"<Step: {step_of('dc_servo').verdict}>"


@pytest.mark.parametrize(
    ("start", "end", "critical"), [(90.0, 210.0, -180.0), (0.0, -870.0, -900.0), (-90.0, -150.0, -180.0)]
)
def test_a_phase_margin_is_drawn_from_a_dotted_line(start: float, end: float, critical: float) -> None:
    """Of a plant that rotates ahead, of a long delay, and of an integrator."""
    frequencies = np.geomspace(0.1, 10.0, 401)
    phases = start + (end - start) * np.log10(frequencies / 0.1)
    phases[200:] = end
    (known,) = bode_of("dc_servo").loops
    loop = dataclasses.replace(known, crossover=1.0, phase_margin=30.0, gain_margins=())
    gains = np.array([np.exp(1j * np.radians(phases)) / frequencies])
    drawn = dataclasses.replace(bode_of("dc_servo"), loops=(loop,), frequencies=frequencies, gains=gains)
    assert np.interp(1.0, frequencies, drawn.phases[0]) == pytest.approx(critical + 30.0)
    _, phase, *_ = drawn.plot()["bode"].axes
    assert np.asarray(phase.lines[1].get_ydata()) == pytest.approx([critical, critical + 30.0])
    dotted = [float(np.asarray(line.get_ydata())[0]) for line in phase.lines if line.get_linestyle() == ":"]
    assert critical in dotted
    assert phase.get_ylim()[0] < critical


def test_a_phase_that_turns_at_half_the_sampling_rate_is_drawn_up_to_there() -> None:
    """As of a cart under a pendulum: its loop gain, real there, has a zero all but there."""
    known = bode_of("dc_servo")
    z = np.exp(1j * known.frequencies * known.dt)
    turning = dataclasses.replace(known, stable=False, loops=(), gains=np.array([0.01 * (z + 1.0001) / (z - 1.0)]))
    assert abs(np.diff(turning.phases[0])[-1]) > 80.0
    _, phase, *_ = turning.plot()["bode"].axes
    at, drawn = np.transpose(phase.lines[0].get_xydata())
    assert np.abs(np.diff(drawn)).max() < 2.0
    assert at[-1] > 0.99 * math.pi / known.dt


def test_the_size_of_a_margin_crosses_no_curve_where_the_gain_is_1_beside_a_resonance() -> None:
    """As that of an elastic shaft, at two thirds of the frequency of the margin, between a notch and a flat end."""
    frequencies = np.geomspace(1.0, 1500.0, 1501)
    at = 1j * frequencies
    gains = np.array([(at**2 + 6.0 * at + 200.0**2) / (at**2 + 30.0 * at + 360.0**2) / at / (at + 12.0)])
    gains /= np.interp(420.0, frequencies, np.abs(gains[0]))
    (known,) = bode_of("dc_servo").loops
    margin = GainMargin(factor=1.0 / float(np.interp(560.0, frequencies, np.abs(gains[0]))), frequency=560.0)
    loop = dataclasses.replace(known, crossover=420.0, gain_margins=(margin,))
    drawn = dataclasses.replace(bode_of("dc_servo"), loops=(loop,), frequencies=frequencies, gains=gains)
    gain, *_ = drawn.plot()["bode"].axes
    curve, (size, _) = gain.lines[0], gain.texts
    box, path = size.get_window_extent(), curve.get_transform().transform_path(curve.get_path())
    assert not path.intersects_bbox(box, filled=False)
    assert gain.bbox.containsx(box.x1)
