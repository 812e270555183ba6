"""The maps of a period against the master's own, wherever the messages and samples fall in it."""

import dataclasses
import functools
import itertools
import math
from typing import Any

import numpy as np
import pytest

from orchestration.components.fmi.reuse import Instances
from orchestration.foundation.basics.errors import UsageError
from orchestration.foundation.basics.simulator import Floats
from orchestration.systems.system.model import System
from orchestration.systems.system.paths import changed
from orchestration.theory.certificates.breaking import unstable_sequence
from orchestration.theory.certificates.certified_loop import (
    BOXES,
    DELAY,
    JITTER,
    LATENCY,
    LOSS,
    SHIFT,
    CertifiedLoop,
    Varying,
    certified_loop,
)
from orchestration.theory.certificates.family import LoopFamily
from orchestration.theory.certificates.find_certificate import find_certificate
from orchestration.theory.certificates.timeline import LoopTimeline
from orchestration.theory.stability.loop_at_rest import at_rest
from orchestration.theory.stability.period_map import growth_of_loop
from tests.examples.common import native_example as example
from tests.extent import sample
from tests.orchestration.theory.certificates.loops import cascade, through_a_filter

PERIOD = 0.5
COMMAND = Varying(kind=DELAY, name="command", path="connections.command.delay_jitter")
MEASUREMENT = Varying(kind=DELAY, name="measurement", path="connections.measurement.delay_jitter")
SAMPLE = Varying(kind=JITTER, name="controller", path="components.controller.sampling.jitter")
LOST = Varying(kind=LOSS, name="command", path="connections.command.loss")
LOST_MEASUREMENT = Varying(kind=LOSS, name="measurement", path="connections.measurement.loss")


@pytest.fixture(scope="module")
def system() -> System:
    slow = {"components.controller.sampling.period": PERIOD}
    return changed(dataclasses.replace(example("double_integrator"), stop_time=20.0), slow)


def loop(system: System, instances: Instances) -> CertifiedLoop:
    with at_rest(system, instances) as rest:
        return certified_loop(rest)


def radius_of(family: LoopFamily, value: float) -> float:
    """Of the same draw again and again."""
    maps = [
        family.at(letter, [value])
        for letter in family.letters
        if letter.ranges[0][0] <= value <= letter.ranges[0][1]
    ]  # fmt: skip
    return float(np.abs(np.linalg.eigvals(functools.reduce(lambda a, b: b @ a, maps))).max())


@pytest.mark.parametrize(
    ("varying", "path", "changes"),
    sample(
        [
            (COMMAND, "connections.command.delay", {"connections.command.delay": 0.3}),
            (COMMAND, "connections.command.delay", {"connections.command.delay": 1.2}),
            (COMMAND, "connections.command.delay", {"connections.command.order": "jacobi"}),
            (COMMAND, "connections.command.delay", {"connections.measurement.delay": 0.13}),
            (
                COMMAND,
                "connections.command.delay",
                {
                    "components.controller.sampling.offset": 0.2,
                    "components.controller.sampling.clock_ratio": 1.25,
                    "connections.command.scale": 0.7,
                    "connections.command.delay": 0.45,
                },
            ),
            (MEASUREMENT, "connections.measurement.delay", {"connections.measurement.delay": 0.9}),
            (MEASUREMENT, "connections.measurement.delay", {"connections.command.delay": 0.2}),
        ],
        4,
    ),
)
def test_a_delay_that_stays_is_the_masters(
    system: System, instances: Instances, varying: Varying, path: str, changes: dict[str, Any]
) -> None:
    as_it_is = changed(system, changes)
    nominal, jitter = loop(as_it_is, instances), 0.35
    family = LoopTimeline(nominal, [varying]).family([jitter])
    seconds = float(nominal.period) / 1e9
    delay = changes.get(path, 0.0)
    for value in (0.11, jitter):
        expected = math.exp(seconds * growth_of_loop(changed(as_it_is, {path: delay + value}), instances))
        assert radius_of(family, value) == pytest.approx(expected, abs=1e-9)


def test_a_start_moves_the_sample_and_not_the_message(system: System, instances: Instances) -> None:
    early = loop(changed(system, {"connections.command.delay": 0.3}), instances)
    family = LoopTimeline(early, [Varying(kind=SHIFT, name="controller", path="start")]).family([0.25])
    for late in (0.11, 0.25):
        shorter = changed(system, {"connections.command.delay": round(0.3 - late, 6)})
        expected = math.exp(PERIOD * growth_of_loop(shorter, instances))
        assert radius_of(family, late) == pytest.approx(expected, abs=1e-9)


def test_a_latency_is_of_all_that_a_component_sends(system: System, instances: Instances) -> None:
    of = loop(changed(system, {"connections.command.delay": 0.1}), instances)
    latency = Varying(kind=LATENCY, name="controller", path="latency")
    found, expected = (LoopTimeline(of, [each]).family([0.3]) for each in (latency, COMMAND))
    assert found.letters == expected.letters


def test_two_that_are_limited_in_sum_may_each_be_as_large_as_the_sum(system: System, instances: Instances) -> None:
    both = LoopTimeline(loop(system, instances), [SAMPLE, COMMAND])
    with pytest.raises(UsageError, match="expected less, so that no message is open"):
        both.family([0.4, 0.4])
    letters = both.family([0.4, 0.4], largest_sum=0.4).letters
    drawn = np.random.default_rng(3).uniform(0.0, 0.4, (200, 2))
    for point in drawn[drawn.sum(axis=1) <= 0.4]:
        assert any(all(low <= x <= high for x, (low, high) in zip(point, letter.ranges)) for letter in letters)
    assert max(sum(high for _, high in letter.ranges) for letter in letters) == pytest.approx(0.4 * (1.0 + 1.0 / BOXES))


def test_where_the_order_depends_on_the_draw_there_is_a_letter_for_each(system: System, instances: Instances) -> None:
    nominal = loop(changed(system, {"connections.command.delay": 0.3}), instances)
    family = LoopTimeline(nominal, [COMMAND]).family([0.35])
    assert [letter.ranges for letter in family.letters] == [((0.0, 0.2),), ((0.2, 0.35),)]
    at_once, just_after = (family.at(letter, [0.2]) for letter in family.letters)
    assert at_once == pytest.approx(
        just_after, abs=1e-12
    )  # a command that arrives at a sample comes after it or before


@pytest.mark.parametrize(("kind", "name"), [(JITTER, "filter"), (DELAY, "between")])
def test_a_draw_of_0_may_have_an_order_of_its_own(kind: str, name: str) -> None:
    """A law reads what a filter passes on at its own instant, and as soon as that is late only at its next one."""
    timeline = LoopTimeline(through_a_filter(), [Varying(kind=kind, name=name, path=name)])
    at_once, late = timeline.family([0.02]).letters
    assert (at_once.ranges, late.ranges) == (((0.0, 0.0),), ((0.0, 0.02),))
    times = [factor.times for letter in (at_once, late) for factor in letter.product if factor.times is not None]
    assert {len(each) for each in times} == {2}  # a proof needs a share of the draw in each, be it 0
    assert unstable_sequence(timeline.family([0.0])) is None
    broken = unstable_sequence(timeline.family([0.02]))
    assert broken is not None
    assert sorted(letter for letter, _ in broken[0]) == [0, 1]


def test_samples_that_are_all_late_by_the_same_are_not_late(system: System, instances: Instances) -> None:
    family = LoopTimeline(loop(changed(system, {"connections.command.delay": 0.1}), instances), [SAMPLE]).family([0.3])
    expected = radius_of(family, 0.0)
    assert radius_of(family, 0.3) == pytest.approx(expected, abs=1e-10)


def test_a_late_sample_with_a_late_command_is_the_sum_of_both(system: System, instances: Instances) -> None:
    """Of the sample, and of its command: x after it is as by hand, for a double integrator under u = -x - v."""
    family = LoopTimeline(loop(system, instances), [SAMPLE, COMMAND]).family([0.1, 0.3])
    late, wait = 0.07, 0.21
    flow = [
        np.array([[1.0, t, 0.5 * t * t], [0.0, 1.0, t], [0.0, 0.0, 1.0]]) for t in (late, wait, PERIOD - late - wait)
    ]
    command = np.array([[-1.0, -1.0, 0.0]]) @ flow[0]
    after = flow[1] @ flow[0]
    after[2] = command
    whole = flow[2] @ after
    assert len(family.kept) == 3
    eigenvalues = np.sort_complex(np.linalg.eigvals(family.at(family.letters[0], [late, wait])))
    assert eigenvalues == pytest.approx(np.sort_complex(np.linalg.eigvals(whole)), abs=1e-9)


@pytest.mark.parametrize("delay", [0.0, 0.2])
def test_what_is_lost_leaves_the_command_as_it_was(system: System, instances: Instances, delay: float) -> None:
    """Every second message lost is a sample every second period, the delay as it is."""
    nominal = changed(system, {"connections.command.delay": delay})
    family = LoopTimeline(loop(nominal, instances), [LOST]).family(run=1)
    arrives, lost = (family.at(letter) for letter in family.letters)
    radius = np.abs(np.linalg.eigvals(lost @ arrives)).max()
    slower = changed(nominal, {"components.controller.sampling.period": 2.0 * PERIOD})
    assert radius == pytest.approx(math.exp(2.0 * PERIOD * growth_of_loop(slower, instances)), abs=1e-9)
    assert [letter.moves for letter in family.letters] == [((0, 0), (1, 0)), ((0, 1),)]


def test_a_law_without_memory_says_the_same_where_its_measurement_is_lost(system: System, instances: Instances) -> None:
    """So to lose every second measurement is to lose every second command."""
    of = loop(system, instances)
    radii = []
    for what in (LOST, LOST_MEASUREMENT):
        family = LoopTimeline(of, [what]).family(run=1)
        arrives, lost = (family.at(letter) for letter in family.letters)
        radii.append(np.abs(np.linalg.eigvals(lost @ arrives)).max())
    assert radii[0] == pytest.approx(radii[1], abs=1e-12)


def test_draws_that_would_be_open_at_once_are_refused(system: System, instances: Instances) -> None:
    of = loop(changed(system, {"connections.command.delay": 0.1}), instances)
    assert LoopTimeline(of, [SAMPLE]).largest() == pytest.approx(0.4)
    assert LoopTimeline(of, [COMMAND]).largest() == pytest.approx(0.5)
    with pytest.raises(UsageError, match=r"connections\.command\.delay_jitter: expected less"):
        LoopTimeline(of, [COMMAND]).family([0.51])


def test_what_is_not_for_this_is_refused(system: System, instances: Instances) -> None:
    with pytest.raises(UsageError, match=r"connections\.command\.hold: expected zero"):
        loop(changed(system, {"connections.command.hold": "first"}), instances)


def test_a_law_that_integrates_over_its_step_is_refused_with_late_samples(system: System, instances: Instances) -> None:
    of = loop(system, instances)
    assert not of.depends_on_step("controller")
    law: Any = of.components["controller"]
    integrates = {**of.components, "controller": dataclasses.replace(law, depends_on_step=True)}
    advice = r"expected connections\.command\.delay_jitter, limit of components\.controller\.sampling\.jitter, which"
    with pytest.raises(UsageError, match=f"samples of controller depend on the time to the next one.*{advice}"):
        LoopTimeline(dataclasses.replace(of, components=integrates), [SAMPLE])


# -- two draws that change the order of events -------------------------------------------------------------------------

OUTER = (Varying(kind=JITTER, name="outer", path="late"), Varying(kind=LATENCY, name="outer", path="wait"))


@pytest.fixture(scope="module")
def reordered() -> LoopFamily:
    return LoopTimeline(cascade(), OUTER).family([0.3, 0.6], largest_sum=0.7)


def true_map(family: LoopFamily, point: tuple[float, float]) -> Floats:
    """The map of a letter with these draws that is the loop in which they are constant."""
    constant = LoopTimeline(cascade(late=point[0], wait=point[1]), []).family()
    period = functools.reduce(lambda total, x: constant.at(x) @ total, constant.letters, np.eye(len(constant.kept)))
    within = [x for x in family.letters if all(a <= y <= b for y, (a, b) in zip(point, x.ranges))]
    maps = [family.at(letter, point) for letter in within]
    return next(M for M in maps if np.allclose(_traces(M), _traces(period), rtol=0.0, atol=1e-9))


def _traces(M: Floats) -> list[float]:
    """Of its powers, which do not depend on when the period begins."""
    return [np.trace(np.linalg.matrix_power(M, k)) for k in (1, 2, 3)]


def test_each_order_of_events_has_a_letter_that_is_the_loop_at_its_draws(reordered: LoopFamily) -> None:
    """Where events are of one instant, too: a sample or arrival of the inner law, and both at once."""
    drawn = [(x, y) for x, y in np.random.default_rng(5).uniform(0.0, [0.3, 0.6], (40, 2)).round(3) if x + y <= 0.7]
    ties = itertools.product((0.0, 0.04, 0.1, 0.25, 0.3), (0.0, 0.1, 0.15, 0.21, 0.25, 0.4))
    maps = [true_map(reordered, point) for point in (*drawn, *ties, (0.0, 0.5), (0.1, 0.6), (0.04, 0.46))]
    random = np.random.default_rng(2)
    for length in (1, 2, 3, 5, 8, 12):  # a proof follows
        for _ in range(100):
            product = functools.reduce(np.matmul, [maps[i] for i in random.integers(len(maps), size=length)])
            assert np.abs(np.linalg.eigvals(product)).max() < 1.0


def test_over_all_orders_a_proof_is_found_and_beyond_a_sequence_grows(reordered: LoopFamily) -> None:
    assert find_certificate(reordered, ["here"]) is not None
    wider = LoopTimeline(cascade(), OUTER).family([0.3, 0.7], largest_sum=0.8)
    maps = [true_map(wider, point) for point in ((0.26, 0.41), (0.11, 0.69), (0.0, 0.0))]
    assert np.abs(np.linalg.eigvals(functools.reduce(np.matmul, maps))).max() > 1.02
    assert find_certificate(wider, ["here"]) is None


def test_events_that_commute_may_change_places_in_one_letter(reordered: LoopFamily) -> None:
    """A wish that arrives at the inner law changes nothing at once: only at its next sample."""
    orders = {tuple(factor.matrix for factor in letter.product if factor.times is None) for letter in reordered.letters}
    assert len(orders) < len(reordered.letters)
    counts = {order: sum(event.startswith("outer samples") for event in order) for order in orders}
    assert set(counts.values()) == {1}
