"""Motions by name: their derivatives are those of their positions, and they ease in from rest."""

import math

import mpmath
import numpy as np
import pytest

from fmu_kit.trajectory import Reference, Trajectory
from orchestration.simulation.engines.sources import EXACT, motion_values
from orchestration.systems.signals.library import KINDS, SIGNALS, make_signal
from orchestration.systems.signals.motions import MOTIONS, Circle, Helix, Lemniscate, Motion, Paper, Step
from orchestration.systems.system.connection import MOTION
from quadcosim import UsageError
from tests.scalars import PRECISE

EXAMPLES = {
    "hover": {"x": 1.0, "z": -2.0},
    "step": {"dx": 2.0, "dz": -1.0, "start": 0.5, "duration": 1.7},
    "circle": {"radius": 1.5, "period": 7.0, "ramp": 2.0, "y": 3.0},
    "lemniscate": {"radius": 1.5, "speed": 1.2, "ramp": 2.0},
    "helix": {"radius": 1.5, "period": 7.0, "ramp": 2.0, "rate_z": -0.3},
    "paper": {"ramp": 2.0},
}


def orders(one: Reference) -> list[list[float]]:
    return [[*each] for each in (one.position, one.velocity, one.acceleration, one.jerk, one.snap)]


def of(name: str) -> Motion:
    motion: Motion = make_signal(name, EXAMPLES[name])
    return motion


@pytest.mark.parametrize("name", MOTIONS)
@pytest.mark.parametrize("t", ["0.73", "1.31", "4.07"])  # on the ramp, on the step, after both
def test_derivatives_are_those_of_the_position_in_fifty_digits(name: str, t: str) -> None:
    motion = of(name)
    with mpmath.workdps(50):
        time = mpmath.mpf(t)
        found = orders(motion.at(time, PRECISE))
        for axis in range(3):
            for order in range(1, 5):
                true = mpmath.diff(lambda x, axis=axis: orders(motion.at(x, PRECISE))[0][axis], time, order)
                assert abs(found[order][axis] - true) < mpmath.mpf("1e-8")  # the coefficients are floats


@pytest.mark.parametrize("name", MOTIONS)
def test_position_to_snap_are_continuous_where_a_motion_changes_its_formula(name: str) -> None:
    motion = of(name)
    for t in (0.5, 2.0, 2.2):
        before, behind = (orders(motion.at(math.nextafter(t, way))) for way in (-math.inf, math.inf))
        assert np.array(before) == pytest.approx(np.array(behind), abs=1e-9)


@pytest.mark.parametrize("name", sorted({*MOTIONS} - {"step"}))
def test_a_motion_with_a_ramp_begins_at_rest_at_its_first_point(name: str) -> None:
    given = {"x": 1.0, "y": -2.0, "z": 0.5} if name != "paper" else {"start_z": 0.5}
    begin = orders(make_signal(name, given | ({} if name == "hover" else {"ramp": 1.5})).at(0.0))
    assert begin[0] == pytest.approx([given.get("x", 0.0), given.get("y", 0.0), 0.5], abs=1e-15)
    assert not np.any(begin[1:])


def test_after_its_ramp_a_motion_is_half_the_ramp_late() -> None:
    early, late = Circle(ramp=0.0), Circle(ramp=3.0)
    assert np.array(orders(late.at(9.0))) == pytest.approx(np.array(orders(early.at(7.5))), abs=1e-12)


def test_a_step_rests_before_and_after_and_is_half_way_in_the_middle() -> None:
    step = Step(dx=2.0, start=1.0, duration=4.0)
    for t, x in ((0.0, 0.0), (1.0, 0.0), (5.0, 2.0), (9.0, 2.0)):
        assert orders(step.at(t)) == [[x, 0.0, 0.0]] + 4 * [[0.0] * 3]
    assert step.at(3.0).position.x == pytest.approx(1.0)


def test_the_paper_without_a_ramp_is_the_built_in_trajectory() -> None:
    for t in (0.0, 1.3, 17.0):
        assert np.array(orders(Paper().at(t))) == pytest.approx(np.array(orders(Trajectory().at(t))), abs=1e-15)


def test_circles_keep_their_radius_and_begin_towards_north() -> None:
    circle = Circle(radius=1.5, speed=0.6, ramp=0.0)
    points = np.array([[*circle.at(t).position] for t in np.linspace(0.0, 20.0, 50)])
    assert np.linalg.norm(points - [0.0, 1.5, 0.0], axis=1) == pytest.approx(1.5)
    assert [*circle.at(0.0).velocity] == pytest.approx([0.6, 0.0, 0.0])


def test_a_speed_is_the_largest_on_the_way() -> None:
    for kind in (Circle, Helix, Lemniscate):
        velocities = np.array([[*kind(speed=1.7).at(t).velocity] for t in np.linspace(0.0, 40.0, 4001)])
        assert np.linalg.norm(velocities[:, :2], axis=1).max() == pytest.approx(1.7, rel=1e-4)


def test_the_step_of_degree_nine_is_the_one_whose_four_derivatives_vanish_at_both_ends() -> None:
    import sympy

    x = sympy.Symbol("x")
    polynomial = 126 * x**5 - 420 * x**6 + 540 * x**7 - 315 * x**8 + 70 * x**9
    assert polynomial.subs(x, 1) == 1
    assert all(sympy.diff(polynomial, x, n).subs(x, end) == 0 for n in (1, 2, 3, 4) for end in (0, 1))
    step = Step(dx=1.0, start=0.0, duration=1.0)
    for n, found in enumerate(orders(step.at(0.3))):
        assert found[0] == pytest.approx(float(sympy.diff(polynomial, x, n).subs(x, sympy.Rational(3, 10))))


@pytest.mark.parametrize("name", MOTIONS)
def test_many_times_at_once_give_the_bits_of_one_after_the_other(name: str) -> None:
    motion, times = of(name), np.linspace(0.0, 9.0, 97)
    together = motion_values(motion)(times)
    assert together.shape == (97, len(MOTION))
    assert (together == np.concatenate([motion_values(motion)(times[i : i + 1]) for i in range(97)])).all()
    assert EXACT.sin(times).tolist() == [math.sin(t) for t in times.tolist()]


@pytest.mark.parametrize(
    ("name", "parameters", "line"),
    [
        ("circel", {}, "signal = circel: did you mean circle? expected one of hover, step, circle"),
        ("circle", {"radios": 1.0}, "parameters.radios: circle has no such parameter; did you mean radius?"),
        ("circle", {"radius": 0.0}, "parameters.radius = 0.0: expected a positive number"),
        ("circle", {"ramp": -1.0}, "parameters.ramp = -1.0: expected zero or a positive number"),
        ("circle", {"period": 1.0, "speed": 1.0}, "parameters.speed = 1.0: expected none beside period"),
        ("step", {"duration": 0.0}, "parameters.duration = 0.0: expected a positive number"),
        ("hover", {"x": math.inf}, "parameters.x = inf: expected a finite number"),
        ("hover", {"x": True}, "parameters.x = True: expected a finite number"),
        ("dryden", {"height": 1.0}, "parameters.height = 1.0: expected 3.048 to 304.8 m"),
        ("dryden", {"step": 0.0}, "parameters.step = 0.0: expected a positive number"),
    ],
)
def test_an_invalid_signal_is_rejected_in_one_line(name: str, parameters: dict[str, float], line: str) -> None:
    with pytest.raises(UsageError) as error:
        make_signal(name, parameters)
    assert str(error.value).startswith(line)


def test_every_name_is_a_motion_or_a_wind() -> None:
    from orchestration.systems.signals import WINDS

    assert [*KINDS["wind"]] == [*WINDS]
    assert {**KINDS["motion"], **KINDS["wind"]} == SIGNALS
