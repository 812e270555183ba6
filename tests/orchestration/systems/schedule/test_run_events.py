"""The events of tasks and frames during a run do not depend on when they are requested."""

from itertools import pairwise

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from orchestration.foundation.recording.recording import Event
from orchestration.simulation.engines.backlog import RunEvents
from orchestration.simulation.runs.scheduling import schedule
from orchestration.systems.schedule.resources import timeline_of
from orchestration.systems.system.computers import Computer, Task
from orchestration.systems.system.model import System
from tests.extent import tries
from tests.orchestration.simulation.engines.systems_on_computers import systems_on_computers

NO_MESSAGES = np.zeros((0, 4), dtype=np.int64)


@settings(max_examples=tries(40, sampled=5), derandomize=True, deadline=None)
@given(systems_on_computers(), st.lists(st.tuples(st.floats(0.0, 1.0), st.booleans()), max_size=8))
def test_events_are_the_same_in_parts_of_any_length_and_behind_any_time(
    system: System, parts: list[tuple[float, bool]]
) -> None:
    """Some parts are discarded unread, as before the point at which a run was paused."""
    stop, whole = round(system.stop_time * 1e9), list(timeline_of(system).happenings())
    run_events, found, expected = RunEvents(system), list[Event](), list[Event]()
    ends = [(-1, True), *sorted((round(share * stop), is_asked) for share, is_asked in parts), (stop, True)]
    for (begin, _), (end, is_asked) in pairwise(ends):
        if is_asked:
            found += run_events.with_messages(NO_MESSAGES, end)
            expected += [event for event in whole if begin < event.time <= end]
        run_events.discard_until(end)
    assert found == expected


@settings(max_examples=tries(40, sampled=5), derandomize=True, deadline=None)
@given(systems_on_computers())
def test_events_agree_with_the_jobs_and_frames(system: System) -> None:
    timeline = timeline_of(system)
    found = {(event.kind, event.what, event.sample): event.time for event in timeline.happenings()}

    def times_of(kind: str, what: str) -> dict[int, int]:
        return {sample: time for (a, b, sample), time in found.items() if (a, b) == (kind, what)}

    for name, jobs in timeline.jobs.items():
        assert times_of("finished", name) == {int(k): int(jobs.ended[k]) for k in np.flatnonzero(jobs.done)}
        late = np.maximum(jobs.deadline, jobs.released)
        assert times_of("missed", name) == {int(k): int(late[k]) for k in np.flatnonzero(jobs.missed)}
        begun = dict(enumerate(jobs.released.tolist()))
        assert times_of("released", name) | times_of("skipped", name) == begun
    for name, frames in timeline.frames.items():
        assert times_of("queued", name) == dict(enumerate(frames.queued.tolist()))
        assert times_of("transmitted", name) == {int(k): int(frames.ended[k]) for k in np.flatnonzero(frames.done)}


def test_a_job_released_behind_its_deadline_is_missed_when_it_is_released() -> None:
    task = Task(period=0.1, offset=0.03, jitter=0.025, deadline=0.001, execution=0.0)
    run_events = RunEvents(System(stop_time=0.1, seed=0, computers={"one": Computer(tasks={"late": task})}))
    assert not list(run_events.with_messages(NO_MESSAGES, 35_000_000))
    events = list(run_events.with_messages(NO_MESSAGES, 100_000_000))
    assert [event.kind for event in events] == ["released", "started", "finished", "missed"]
    assert len({event.time for event in events}) == 1


def test_of_a_starved_task_only_jobs_that_are_not_late_yet_are_kept() -> None:
    tasks = {"all": Task(period=0.001, execution=0.001), "none": Task(period=0.001, priority=2)}
    system = System(stop_time=10.0, computers={"one": Computer(tasks=tasks)})
    assert schedule(system).verdict.startswith("deadlines missed in 10 s: one.none 100 % (never ran); ")
    run_events = RunEvents(system)
    found = run_events.with_messages(NO_MESSAGES, 9_999_500_000)
    missed = found.table[found.are("missed", "one.none")]
    assert missed[:, 3].tolist() == list(range(9999))
    assert missed[:, 0].tolist() == [1_000_000 * (k + 1) for k in range(9999)]
