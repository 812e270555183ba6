"""Draws of several components: what is late at once, and what samples read of messages that arrive at any time."""

import functools
import itertools
from collections.abc import Sequence

import numpy as np
import pytest

from orchestration.foundation.basics.errors import UsageError
from orchestration.foundation.basics.simulator import Floats
from orchestration.theory.certificates.certified_loop import JITTER, LATENCY, Varying
from orchestration.theory.certificates.family import LoopFamily
from orchestration.theory.certificates.timeline import LoopTimeline
from tests.orchestration.theory.certificates.loops import behind_a_sensor, cascade

OUTER = Varying(kind=JITTER, name="outer", path="here")
INNER = Varying(kind=LATENCY, name="inner", path="here")
EARLIEST, LATEST = 0.3, 0.6
LATE, MORE = 0.12, 0.05


@pytest.fixture(scope="module")
def family() -> LoopFamily:
    """The outer law is late by up to 0.12 s, and the command of the inner one by 0.05 s: both vary about 0.11 s."""
    timeline = LoopTimeline(cascade(wait=EARLIEST), [OUTER, INNER], {"wish": round(1e9 * LATEST)})
    assert [piece.quantities for piece in timeline.pieces([LATE, MORE])] == [(0, 1), (1,), (1,), (1,)]
    return timeline.family([LATE, MORE])


def passed(t: float) -> Floats:
    """Position, speed, force and a held number after a time."""
    return np.array([[1.0, t, t * t / 2, 0.0], [0.0, 1.0, t, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]])


def monodromy(late: float, latencies: Sequence[float], read: int) -> Floats:
    """The loop from 0.95 s to 1.95 s by events: position, speed, command, wish, which the `read`-th sample reads."""
    events = sorted([
        (late, "outer", 0), *((0.25 * k, "inner", k) for k in range(4)),
        *((0.25 * k + 0.1 + latencies[k], "command", k) for k in range(4)), (0.95, "end", 0),
    ])  # fmt: skip
    state, at, sent, commands = np.eye(4), -0.05, np.zeros(4), np.zeros((4, 4))
    for time, event, k in events:
        state, at = passed(time - at) @ state, time
        if event == "outer":
            sent = -0.9 * state[0]
        elif event == "inner":
            if k == read:
                state[3] = sent
            commands[k] = 1.8 * state[3] - 1.8 * state[1]
        elif event == "command":
            state[2] = commands[k]
    return state


def traces(M: Floats) -> list[float]:
    """Of its powers, which do not depend on coordinates, nor on when the period begins."""
    return [np.trace(np.linalg.matrix_power(M, k)) for k in (1, 2, 3, 4)]


def words(pieces: Sequence[Sequence[Floats]]) -> list[list[float]]:
    """The traces of each product of one map of each piece."""
    return [traces(functools.reduce(lambda M, x: x @ M, word)) for word in itertools.product(*pieces)]


def test_letters_are_the_loop_with_its_own_draw_for_each_sample(family: LoopFamily) -> None:
    """Once with each sample that may be the first to read a wish: from the latest arrival on it does."""
    pieces = [[x for x in family.letters if x.name.startswith(f"late {i}")] for i in (1, 2, 3, 4)]
    random = np.random.default_rng(3)
    for _ in range(25):
        late, latencies = random.uniform(0.0, LATE), random.uniform(0.0, MORE, 4).tolist()
        points = [(late, latencies[0]), *((0.0, each) for each in latencies[1:])]
        fitting = [
            [family.at(x, point) for x in piece if all(a <= y <= b for y, (a, b) in zip(point, x.ranges))]
            for piece, point in zip(pieces, points)
        ]
        found = words(fitting)
        real = [traces(monodromy(late, latencies, read)) for read in (2, 3)]
        for each in real:
            assert any(np.allclose(each, other, rtol=0.0, atol=1e-9) for other in found)
        for other in found if late < 0.1 else ():  # beyond, the boxes of an order have draws of another one
            assert any(np.allclose(each, other, rtol=0.0, atol=1e-9) for each in real)


@pytest.mark.parametrize(("latest", "read"), [(0.04, [0.25]), (0.05, [0.0, 0.25]), (0.24, [0.0, 0.25])])
def test_of_messages_that_come_more_often_than_they_are_read_it_is_the_last(latest: float, read: list[float]) -> None:
    """The one at 0.25 s may arrive after the sample at 0.3 s: then that reads the one at 0 s, which is overwritten."""
    family = LoopTimeline(behind_a_sensor(), [], {"message": round(1e9 * latest)}).family()
    pieces = [[family.at(x) for x in family.letters if x.name.startswith(f"late {i}")] for i in (1, 2, 3, 4)]
    real = []
    for time in read:
        after = passed(0.4)
        after[2:] = -0.5 * passed(time)[0], np.zeros(4)
        real.append(traces(passed(0.6) @ after))
    np.testing.assert_allclose(sorted(words(pieces)), sorted(real), rtol=0.0, atol=1e-9)


def test_a_message_that_may_arrive_after_the_next_sample_of_its_sender_is_refused() -> None:
    timeline = LoopTimeline(cascade(wait=EARLIEST), [OUTER], {"wish": 10**9})
    with pytest.raises(UsageError, match=r"^here: a message of connections\.wish may arrive when the next one is sam"):
        timeline.family([LATE])


def test_more_than_two_times_that_vary_at_once_are_refused() -> None:
    timeline = LoopTimeline(cascade(), [OUTER, INNER], {"wish": round(1e9 * LATEST)})
    with pytest.raises(UsageError, match=r"^here: 3 times of outer and inner vary at once, of 2 at most"):
        timeline.family([0.36, MORE])
    with pytest.raises(UsageError, match=r"^here: expected quantities of one sampled component"):
        timeline.largest()
