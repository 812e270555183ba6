"""Poles over a quantity: those of python-control, which leave the unit circle where the delay margin says."""

import dataclasses
import json
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.figure import Figure

from orchestration.foundation.basics.bisection import Bracket, Range
from orchestration.systems.system.component import Component, Sampling
from orchestration.systems.system.computers import Computer, Task
from orchestration.systems.system.model import System
from orchestration.systems.system.paths import changed
from orchestration.theory.stability import root_locus
from orchestration.theory.stability.local_limit import about_rest
from orchestration.theory.stability.loop_at_rest import whole_at_rest
from orchestration.theory.stability.loop_figures import _rows_of
from orchestration.theory.stability.operating_point import hyperperiod_of
from orchestration.theory.stability.poles import poles_of
from orchestration.theory.stability.root_locus import Crossing, RootLocus
from orchestration.theory.stability.several_rates import commensurate, narrowed
from orchestration.theory.stability.sign_changes import uncertainty
from quadcosim import Timing, UsageError, bode, linearise, locus
from tests.commands import Main
from tests.examples.common import native_example as example
from tests.native import native
from tests.orchestration.experiments.studies.test_systems import DELAY
from tests.places import EXAMPLES


def test_poles_are_those_of_python_control_and_leave_the_circle_at_the_delay_margin(main: Main, tmp_path: Path) -> None:
    file = EXAMPLES / "dc_servo" / "system.toml"
    values = ("--of", DELAY, "--from", "0", "--to", "0.02", "--count", "3")
    found = json.loads(main("locus", file, *values, "--native", "--json", "--out", tmp_path).stdout)
    assert found["values"] == [0.0, 0.002, 0.01, 0.02]
    assert found["verdict"] == (
        f"{DELAY}: poles inside the unit circle at 0 s, leave at 13.4966 ms, 51.1 rad/s (small deviations)"
    )
    servo = example("dc_servo")
    below = locus(servo, DELAY, first=0.0, last=0.01, count=2).verdict
    assert below.startswith(f"{DELAY}: poles inside the unit circle at each of 3 values from 0 s to 10 ms, spectral ")
    (crossing,) = found["crossings"]
    assert crossing["value"] - 0.002 == pytest.approx(bode(servo).loops[0].delay_margin, abs=2e-8)
    assert np.hypot(crossing["real"], crossing["imaginary"]) == pytest.approx(1.0, abs=1e-6)
    assert crossing["frequency"] == pytest.approx(np.arctan2(crossing["imaginary"], crossing["real"]) / 0.006)
    loop = linearise(changed(servo, {DELAY: 0.02}))
    control = pytest.importorskip("control")
    closed = control.feedback(loop.component.to_control() * loop.rest.to_control(), sign=1)
    poles = np.sort_complex([complex(*pole) for pole in found["poles"][3]])
    assert poles == pytest.approx(np.sort_complex(closed.poles()), abs=1e-6)
    assert found["radius"][3] == pytest.approx(loop.radius, rel=1e-9)
    assert (tmp_path / "locus_connections_command_delay.png").read_bytes().startswith(b"\x89PNG")


def test_values_without_poles_take_nothing_from_the_others(monkeypatch: pytest.MonkeyPatch) -> None:
    """Only a range without any is refused."""

    def refusing(system: System, *rest: Any, **named: Any) -> Any:
        if worst < system.connections[-1].delay < best:
            raise UsageError("no rest")
        return whole_at_rest(system, *rest, **named)

    monkeypatch.setattr(root_locus, "whole_at_rest", refusing)
    worst, best = 0.015, 1.0
    found = locus(example("dc_servo"), DELAY, first=0.0, last=0.028, count=3)
    assert found.values.tolist() == [0.0, 0.002, 0.014]
    assert found.verdict == (
        f"{DELAY}: poles inside the unit circle at 0 s, leave at 13.4966 ms, 51.1 rad/s (small deviations); "
        f"no poles at 1 of {found.tried} values tried, as {DELAY} = 0.028: no rest"
    )
    reasons = ["no rest within 20 ms", "it diverges", "no rest within 1.5 s"]
    several = dataclasses.replace(found, without=tuple(f"{DELAY} = {k}e-05: {why}" for k, why in enumerate(reasons)))
    assert f"at 2 of {found.tried} values tried, as {DELAY} = 0e-05: no rest within 20 ms; at 1, as " in several.verdict
    worst, best = 0.013, 0.0145
    found = locus(example("dc_servo"), DELAY, first=0.007, last=0.021, count=3)
    assert (found.values.tolist(), (found.radius < 1.0).tolist()) == ([0.007, 0.021], [True, False])
    (crossing,) = found.crossings
    assert 0.007 <= crossing.value <= worst < best <= crossing.until <= 0.021
    assert "at 7 ms, leave between " in found.verdict
    assert f"{DELAY} = 0.014: no rest" in found.without
    worst, best = -1.0, 1.0
    with pytest.raises(UsageError, match=f"{DELAY} = 0.028: no rest"):
        locus(example("dc_servo"), DELAY, first=0.0, last=0.028, count=3)


def test_a_loop_sampled_between_whole_nanoseconds_has_the_radius_of_its_neighbour() -> None:
    period = "components.controller.sampling.period"
    between, whole = (linearise(example("dc_servo", {period: T})).radius for T in (0.0061234569, 0.006123457))
    assert between == pytest.approx(whole, abs=1e-7)


def test_a_response_that_grows_until_it_cannot_be_followed_hides_no_poles() -> None:
    """That to one input, over four times the period; not beside it: radii at 0.3857 and 0.3858 s are those below."""
    assert 33.0031 < linearise(native(timing=Timing(period=0.385769231))).radius < 33.0229


def test_what_is_forgotten_is_no_pole() -> None:
    """A chain of eight delays alone has eigenvalues of 0, which rounding would move to 1e-2."""
    rotation = np.linalg.qr(np.random.default_rng(3).normal(size=(10, 10)))[0]
    chain = np.diag(np.ones(9), 1)
    chain[7, 8] = chain[8, 9] = 0.0
    chain[8, 8], chain[9, 9], chain[3, 9] = 0.5, -0.25, 4.0
    assert np.sort(poles_of(rotation @ chain @ rotation.T).real) == pytest.approx([-0.25, 0.5])


def test_a_state_in_a_small_unit_is_a_pole_too() -> None:
    """Beside one whose numbers are 1e12 times as large: it moves the largest pole."""
    loop = np.array([[0.99, 2e10, 0.0], [-1e-14, 0.9, 0.0], [0.0, 0.0, 0.0]])
    expected = sorted(abs(np.linalg.eigvals(loop[:2, :2])), reverse=True)
    assert abs(poles_of(loop))[:2] == pytest.approx(expected, rel=1e-9)


def test_a_period_beside_another_crosses_between_two_that_coincide_with_it() -> None:
    """Nearer than a twentieth of the other one, though both values of the locus are two of it apart.

    At 12.8 ms, that of the simplest ratio near by, it is unstable by itself: stable again at 13 ms.
    """
    system, period = example("dc_servo"), "components.controller.sampling.period"
    servo = dataclasses.replace(system.components["servo"], step=None, sampling=Sampling(period=0.008))
    both = dataclasses.replace(system, components={**system.components, "servo": servo})
    found = locus(both, period, first=0.008, last=0.024, count=2)
    crossing, *others = found.crossings
    assert [(one.value, one.until, one.leaves) for one in others] == [(0.013, 0.0128, False), (0.013, 0.0132, True)]
    assert (crossing.value, crossing.until, crossing.leaves) == (0.0125, 0.0128, True)
    assert "leave between 12.5 ms and 12.8 ms; return between 12.8 ms and 13 ms; leave" in found.verdict
    assert f"{found.tried} values examined, at which all rates repeat together" in found.verdict
    stable, unstable = (
        linearise(changed(both, {period: value}), "controller") for value in (crossing.value, crossing.until)
    )
    before, after = stable.radius, unstable.radius
    assert before < 1.0 < after
    assert unstable.turn == crossing.turn
    of_all = hyperperiod_of(changed(both, {period: crossing.until}))
    assert of_all is not None
    (per_longest,) = found.curve[1][found.curve[0] == crossing.until]
    assert f"at {1e3 * crossing.until:g} ms, |z| = {abs(crossing.z):.4g}" in found.pole_of(crossing)
    limit = about_rest(
        lambda value: changed(both, {period: value}), Range(first=0.008, step=0.016, last=0.024, tolerance=1.0)
    )
    assert crossing.turn == pytest.approx(2e9 * np.pi / float(of_all))
    assert (limit.limit, limit.accuracy) == pytest.approx((0.01265, 0.00015), rel=1e-6)
    assert per_longest == pytest.approx(after ** (1e9 * max(crossing.until, 0.008) / float(of_all)), rel=1e-6)


def test_values_of_a_period_move_to_those_at_which_it_meets_the_others() -> None:
    """That of the simplest ratio within half a step, where there is one; else the nearest, as 12 / 25 of 2 ms."""

    def two(period: float, other: float = 0.002) -> System:
        each = {"law": period, "servo": other}
        samplings = {name: Component(fmu=f"{name}.fmu", sampling=Sampling(period=x)) for name, x in each.items()}
        return System(stop_time=9.0, components=samplings)

    rates = commensurate(two, [0.0009, 0.00093, 0.000961, 0.000979, 0.001], instead=True)
    assert rates is not None
    assert (rates.scan, rates.moved) == ([0.0009, 0.0009375, 0.00096, 0.001], 3)
    wide = commensurate(two, [0.0002, 0.000356, 0.000632, 0.00112, 0.002, 0.00356, 0.02], instead=True)
    assert wide is not None
    assert wide.scan == [0.0002, 0.0004, 0.0005, 0.00112, 0.002, 0.004, 0.02]

    def shared(period: float) -> System:
        tasks = {
            name: Task(component=name, period=x, execution=1e-5, priority=k)
            for k, (name, x) in enumerate({"law": period, "servo": 0.00025}.items())
        }
        node = Computer(tasks={**tasks, "comms": Task(period=0.004, execution=1e-4, priority=2)})
        system = two(period, 0.00025)
        alone = {name: dataclasses.replace(one, sampling=None) for name, one in system.components.items()}
        return dataclasses.replace(system, components=alone, computers={"node": node})

    beside = commensurate(shared, [0.00115, 0.00123, 0.0013, 0.0040007, 0.0041], instead=True)
    assert beside is not None
    assert (beside.scan, beside.moved) == ([0.00115, 0.00125, 0.0013, 0.004, 0.0041], 2), "1.2 ms has more phases"
    apart = {"node": Computer(tasks={"comms": Task(period=0.004, execution=1e-4)})}
    alone_on_node = commensurate(
        lambda x: changed(shared(x), {"computers.node.tasks.servo.period": x}), [0.003, 0.0040007, 0.005], instead=True
    )
    assert alone_on_node is not None
    assert alone_on_node.scan == [0.003, 0.004, 0.005], "as a task without a component shares it, too"
    assert commensurate(lambda x: dataclasses.replace(two(x, x), computers=apart), [0.003, 0.005], instead=True) is None
    assert rates.meetings.between(0.00094, 0.00099) == [0.00095, 0.00096]
    assert rates.meetings.between(0.0041, 0.0044) == [0.0041, 0.004125, 0.0042, 0.00425, 0.0043, 0.004375, 0.0044]
    assert all(hyperperiod_of(two(value)) is not None for value in rates.meetings.between(0.0002, 0.03))
    alone = commensurate(lambda value: two(value, 0.0002), [0.007, 0.0075], instead=True)
    assert alone is not None
    passed_by = narrowed(lambda value: value == 0.0072 or value >= 0.00722, Bracket(0.007, 0.0075), alone)
    assert passed_by == (0.00719, 0.0072)
    few = narrowed(lambda x: x >= 0.00722 if round(x * 1e7) % 400 == 0 else None, Bracket(0.007, 0.0075), alone)
    assert few == (0.0072, 0.00724)


def test_a_locus_over_the_period_tells_that_a_law_keeps_its_own(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(root_locus, "isolated_call", lambda *given: None)
    locus(example("dc_servo"), "components.controller.sampling.period", first=0.006, last=0.007, count=2)
    assert "controller keeps its parameter period of 6 ms; with period = " in capsys.readouterr().err
    locus(example("dc_servo"), DELAY, first=0.0, last=0.02, count=2)
    assert "keeps" not in capsys.readouterr().err


def test_a_locus_of_one_value_is_refused() -> None:
    with pytest.raises(UsageError, match="count = 1: expected a number from 2"):
        locus(example("dc_servo"), DELAY, first=0.0, last=0.02, count=1)


def test_over_decades_the_own_value_is_tried_and_crossings_are_at_the_gain_margins() -> None:
    """Of a gain that only the FMU sets, to 0.96: at both ends the loop is unstable."""
    found = locus(example("dc_servo"), "components.controller.parameters.K", first=0.01, last=100.0, count=3)
    assert found.values.tolist() == [0.01, 0.96, 1.0, 100.0]
    assert (found.own, found.geometric) == (0.96, True)
    margins = bode(example("dc_servo")).loops[0].gain_margins
    assert [one.value for one in found.crossings] == pytest.approx([0.96 * one.factor for one in margins], rel=1e-5)
    assert [(one.leaves, one.turn) for one in found.crossings] == [(False, None), (True, None)]
    assert all(one.accuracy is not None and one.accuracy < 1e-5 for one in found.crossings)
    even = locus(example("dc_servo"), "components.controller.parameters.K", first=2.0, last=20.0, count=3)
    assert (even.values.tolist(), even.own, even.geometric) == ([2.0, 11.0, 20.0], None, False)


def test_a_crossing_has_the_digits_that_its_accuracy_bears() -> None:
    def digits(value: float, accuracy: float | None, z: complex = 1.0) -> int:
        return Crossing(value=value, until=value, leaves=True, z=z, frequency=0.0, accuracy=accuracy).digits

    assert [digits(10.6064, each) for each in (1.3e-3, 6e-4, 4e-4, 1e-9, None)] == [4, 4, 5, 6, 4]
    assert digits(10.6064, None, 1.05) == 6
    # A function 2 (x - 3) with an error of 0.01 at each point: points nearer than its error tell nothing.
    points = {x: 2.0 * (x - 3.0) + 0.01 for x in (0.0, 2.0, 2.999, 3.0, 4.0)}
    assert uncertainty(points, 2.995, 0.01) == pytest.approx(0.005, rel=0.02)
    assert uncertainty({1.0: 0.01}, 1.0, 0.01) == np.inf


def test_a_name_that_does_not_exist_is_told_before_a_range_is_asked_for() -> None:
    servo = example("dc_servo")
    with pytest.raises(UsageError, match=r"parameters\.perod: .* did you mean period"):
        locus(servo, "components.controller.parameters.perod")
    with pytest.raises(UsageError, match=r"did you mean controller\?"):
        locus(servo, "components.contoller.parameters.k_p")


def test_a_wide_locus_has_its_labels_in_the_panel_and_says_how_many_poles_lie_beyond_another() -> None:
    places = (0.27, 0.98, 1.02, 1.05, 10.0, 49.5)
    values, radius = np.array([0.0, 1.0, 50.0]), np.array([0.98, 1.0, 45.0])
    crossings = [Crossing(value=x, until=x, leaves=True, z=1.0, frequency=0.0) for x in places]
    found = RootLocus(
        of="components.controller.parameters.gain", unit=None, values=values, radius=radius,
        poles=radius[:, None].astype(complex), crossings=tuple(crossings), curve=np.array([values, radius]),
    )  # fmt: skip
    figure = found.plot()["locus"]
    figure.canvas.draw()
    over, plane = figure.axes[2], figure.axes[0]
    assert over.get_yscale() == "symlog"
    assert plane.get_title().endswith("not shown: 1 of 3 poles, up to |z| = 45")
    assert [text.get_text() for text in over.texts] == ["0.27", "0.98", "1.02", "10", "49.5"]  # no room for a fourth
    labels = [text.get_window_extent() for text in over.texts]
    assert not any(one.overlaps(other) for one, other in combinations(labels, 2))
    panel, curve = over.get_window_extent(), over.transData.transform((50.0, 44.0))[1]
    for label in labels:
        assert panel.x0 <= label.x0 < label.x1 <= panel.x1
        assert curve <= label.y0 < label.y1 <= panel.y1 + 2.0


def test_a_window_of_stability_is_seen_and_poles_that_jump_lie_between_two_values() -> None:
    """Of a radius of 0.99 beside 2: on a linear axis it is no more than the line of 1."""
    values, radius = np.array([1.0, 2.0, 3.0, 4.0, 5.0]), np.array([2.0, 1.2, 0.99, 1.3, 2.0])
    at = Crossing(value=2.5, until=2.5, leaves=False, z=1.0, frequency=0.0)
    jump = Crossing(value=3.0, until=4.0, leaves=True, z=1.3, frequency=0.0)
    found = RootLocus(
        of="components.controller.parameters.gain", unit=None, values=values, radius=radius,
        poles=radius[:, None].astype(complex), crossings=(at, jump), curve=np.array([values, radius]),
    )  # fmt: skip
    figure = found.plot()["locus"]
    figure.canvas.draw()
    over = figure.axes[2]
    assert over.get_ylabel() == "spectral radius − 1"
    bottom, edge, top = over.transAxes.inverted().transform(over.transData.transform([(3.0, y) for y in (-0.01, 0, 1)]))
    assert edge[1] - bottom[1] > 0.1 * (top[1] - edge[1])
    assert over.get_yticks() == pytest.approx([-0.01, 0.0, 0.01, 0.1, 1.0])
    assert [text.get_text() for text in over.texts] == ["2.5", "3 to 4"]
    (band,) = over.patches
    assert band.get_extents().transformed(over.transData.inverted()).intervalx == pytest.approx([3.0, 4.0])
    assert sum(line.get_marker() == "x" for line in over.lines) == 1
    even = dataclasses.replace(found, radius=radius - 0.3, curve=np.array([values, radius - 0.3]))
    assert even.plot()["locus"].axes[2].get_yscale() == "linear"


def test_no_label_of_a_crossing_lies_over_the_line_of_another() -> None:
    axes = Figure(figsize=(8.0, 2.5)).add_subplot()
    axes.set_xlim(1.0, 12.0)
    rows, lefts = _rows_of(axes, [6.14, 8.72, 9.48, 9.5, 11.8], ["6.14 ms", "8.72 ms", "9.48 ms", "9.5 ms", "11.8 ms"])
    assert (rows, lefts) == ([0, 0, 1, 2, 0], [False, False, False, False, True])
