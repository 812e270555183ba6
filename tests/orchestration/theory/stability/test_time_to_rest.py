"""Systems that run to rest, as an integral does away from zero: a DC servo behind a bias of its amplifier."""

import dataclasses
import math
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from orchestration.components.building import builder
from orchestration.components.fmi.reuse import Instances
from orchestration.foundation.basics.simulator import Floats
from orchestration.systems.system.model import System
from orchestration.systems.system.paths import changed, value_at
from orchestration.theory.exact.expect import expect
from orchestration.theory.stability import loop_at_rest
from orchestration.theory.stability.fixed_periods import in_repeated_periods
from orchestration.theory.stability.loop_at_rest import KnownTangents, keep_start
from orchestration.theory.stability.period_map import growth_of_loop
from orchestration.theory.stability.perturbed_runs import growth_of
from quadcosim import UsageError, linearise, locus
from tests.examples.common import native_example
from tests.places import EXAMPLES

BIAS, DELAY, PERIOD, AFTER = 0.3, 0.002, 0.006, "operating_point.after"
FMU, DELAY_PATH = "components.controller.fmu", "connections.command.delay"


@pytest.fixture(scope="module")
def servo() -> System:
    system = native_example("dc_servo", {"connections.command.offset": BIAS})
    return dataclasses.replace(system, operating_point={"after": 3.0})


def by_hand(delay: float = DELAY) -> Floats:
    """The map of the loop of a PID under a delay shorter than a period: angle, speed, last command and three states."""
    K, Ti, Td, N = 0.96, 0.12, 0.049, 10.0

    def flow(t: float) -> tuple[Floats, Floats]:
        left = -np.expm1(-t)
        return np.array([[1.0, left], [0.0, 1.0 - left]]), 1000.0 * np.array([t - left, left])

    (_, first), (later, second) = flow(delay), flow(PERIOD - delay)
    angle, last, integral, derivative, before = np.eye(6)[[0, 2, 3, 4, 5]]
    damped = (Td * derivative - K * Td * N * (angle - last)) / (Td + N * PERIOD)
    u = -K * angle + integral + damped
    moved = flow(PERIOD)[0] @ np.eye(6)[:2] + np.outer(later @ first, before) + np.outer(second, u)
    return np.vstack([moved, angle, integral - K * PERIOD / Ti * angle, damped, u])


def test_an_integral_without_a_parameter_comes_to_rest_by_a_run_and_has_the_poles_of_its_matrices(
    servo: System,
) -> None:
    loop = linearise(servo)
    assert loop.operating_point["controller.u"] == pytest.approx(-BIAS, abs=1e-6)
    expected = np.linalg.eigvals(by_hand())
    found = np.array([one.z for one in loop.poles])
    assert loop.radius == pytest.approx(np.abs(expected).max(), abs=1e-8)
    assert all(np.abs(expected - one).min() < 1e-7 for one in found)


def test_a_period_that_a_parameter_follows_begins_where_the_own_one_has_come_to_rest(
    servo: System, monkeypatch: pytest.MonkeyPatch
) -> None:
    law = servo.components["controller"]
    law = dataclasses.replace(law, parameters={**law.parameters, "period": "sampling.period"})
    follows = dataclasses.replace(servo, components={**servo.components, "controller": law})
    own, begun = loop_at_rest._rested, list[bool]()

    def seen(*given: Any) -> Any:
        begun.append(given[-1] is not None)
        return own(*given)

    monkeypatch.setattr(loop_at_rest, "_rested", seen)
    with closing(Instances()) as instances:
        known = KnownTangents()
        keep_start(follows, instances, known)
        for period in (0.005, 0.0055, 0.005):
            other = changed(follows, {"components.controller.sampling.period": period})
            assert growth_of_loop(other, instances, known=known) == pytest.approx(
                growth_of_loop(other, instances), rel=1e-5
            )
    assert begun == [False, *(True, False) * 3]


def test_other_delays_begin_where_the_own_one_has_come_to_rest_also_where_the_loop_is_unstable(servo: System) -> None:
    """From there no run comes to rest. The edge is that of the loop without a bias, whose rest is given."""
    (crossing,) = locus(servo, DELAY_PATH, first=0.0, last=0.02, count=3).crossings
    assert crossing.leaves
    (given,) = locus(native_example("dc_servo"), DELAY_PATH, first=0.0, last=0.02, count=3).crossings
    assert crossing.value == pytest.approx(given.value, abs=1e-8)
    with pytest.raises(UsageError, match=r"leaves the operating point: .* from which it comes to rest in 3 s"):
        linearise(changed(servo, {DELAY_PATH: 0.02}))


def test_gains_that_are_unstable_have_poles_at_a_rest_that_no_run_finds(servo: System) -> None:
    """That of the controller does not move it, that of the amplifier does. If the own one has none, that is said."""
    gain, own = "components.controller.parameters.K", 0.96
    with closing(Instances()) as instances:
        expected = growth_of_loop(native_example("dc_servo", {gain: 4.0}), instances)
        assert expected > 0.0
        known = KnownTangents()
        keep_start(servo, instances, known)
        assert known.start is not None
        start = known.start
        for path, of in ((gain, 1.0), ("connections.command.scale", own)):
            known.start = start
            found = growth_of_loop(changed(servo, {path: 4.0 / of}), instances, known=known)
            assert found == pytest.approx(expected, rel=1e-6)
    beyond = locus(changed(servo, {gain: 4.0}), gain, first=own, last=4.0, count=2)
    assert beyond.radius[1] == pytest.approx(math.exp(expected * PERIOD), rel=1e-6)
    with pytest.raises(UsageError, match=rf"{gain} = 4: .*unstable here"):
        locus(dataclasses.replace(servo, operating_point={"after": 0.01}), gain, first=0.96, last=4.0, count=2)


def test_a_range_whose_ends_and_own_value_do_not_come_to_rest_begins_from_one_that_does(servo: System) -> None:
    gain = "components.controller.parameters.K"
    found = locus(changed(servo, {gain: 4.0}), gain, first=0.2, last=3.1, count=3)
    given = locus(changed(native_example("dc_servo"), {gain: 4.0}), gain, first=0.2, last=3.1, count=3)
    assert found.radius == pytest.approx(given.radius, rel=1e-6)


def test_a_law_that_begins_anew_settles_for_as_long_as_a_run_does(tmp_path: Path, servo: System) -> None:
    """Its command fades in over a second, by a state that no input moves; then its loop is that without."""
    code, command = (EXAMPLES / "dc_servo" / "controller.py").read_text(), "K * error + self.integral + self.derivative"
    faded = "self.faded = self.faded + 0.1 * (1.0 - self.faded)"
    code = code.replace(
        f"self.u = {command}", f"{faded}\n        self.u = max(0.0, 2.0 * self.faded - 1.0) * ({command})"
    )
    (tmp_path / "controller.py").write_text(code.replace("    K = ", '    faded = Local("share given", "1")\n    K = '))
    builder.build_slaves(builder.slaves_of(tmp_path), tmp_path, packing=builder.IN_PYTHON)
    gain, system = "components.controller.parameters.K", changed(servo, {FMU: str(tmp_path / "PidController.fmu")})
    with closing(Instances()) as instances:
        known, wanted = KnownTangents(), changed(system, {gain: 4.0})
        keep_start(system, instances, known)
        assert known.start is not None
        known.start = dataclasses.replace(known.start, tunable=frozenset())
        begun = known.start.tuned_to(in_repeated_periods(wanted))
        assert begun is not None
        assert list(begun.saved) == ["servo"]
        found = growth_of_loop(wanted, instances, known=known)
        assert found == pytest.approx(growth_of_loop(native_example("dc_servo", {gain: 4.0}), instances), rel=1e-6)


def test_twin_runs_begin_at_the_same_rest(servo: System) -> None:
    """Other parameters come to rest anew, for a saved state holds them."""
    with closing(Instances()) as instances:
        known = KnownTangents()
        for gain in (0.96, 0.8):
            system = changed(servo, {"components.controller.parameters.K": gain})
            expected = growth_of_loop(system, instances, known=known)
            assert growth_of(system, instances, known=known).rate == pytest.approx(expected, abs=1e-5)
        assert known.start is not None
        assert known.start.components["controller"].parameters["K"] == 0.8


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        ({AFTER: 0.0}, r"controller.u goes from 0 V at the start to -0.996 V: expected .* or after = SECONDS there"),
        ({AFTER: 0.5}, r"not at rest after 0.5 s: \S+ moves by .* in 5 periods, and by .*: expected a longer after"),
        (
            {AFTER: 0.5, "components.controller.parameters.K": 3.4},
            "no less than earlier: unstable here, or an oscillation, no rest: expected a loop",
        ),
        ({AFTER: -1.0}, r"operating_point.after = -1.0: expected a time"),
        ({AFTER: "soon"}, r"operating_point.after = soon: expected a time"),
    ],
)
def test_what_does_not_rest_is_refused_with_what_there_is_instead(
    servo: System, changes: dict[str, Any], expected: str
) -> None:
    with pytest.raises(UsageError, match=expected):
        linearise(changed(servo, changes))


def test_initial_values_have_no_distance_from_a_rest_that_a_run_has_found(servo: System) -> None:
    assert value_at(servo, AFTER) == 3.0
    with pytest.raises(UsageError, match="without after"):
        expect(servo, horizon=1.0)
