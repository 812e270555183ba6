"""Rows between the points of a component in continuous time: there its outputs lie on a line to its next point.

A row has what a component gave at its last point, which is older than the row where only others have an instant.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import TypeAlias

import numpy as np

from orchestration.foundation.basics.simulator import Booleans, Floats, Integers
from orchestration.foundation.basics.times import instants_of
from orchestration.foundation.recording.recording import Chunk, Events, InMemory, events_of, rows_of
from orchestration.systems.schedule.plan import FixedStep, Plan, own_outputs
from orchestration.systems.system.connection import component_of
from orchestration.systems.system.model import System

Points: TypeAlias = Callable[[Integers], Mapping[str, Booleans]]
"""Flags by component: whether each of some instants [ns] is a point of it"""


def points_of(system: System, fixed: Mapping[str, FixedStep], end: int) -> Points | None:
    """The points of the components in continuous time in a run up to `end` [ns]; None if all have all instants.

    `fixed` has the components of fixed step.
    """
    if Plan(system).always_together:
        return None
    from orchestration.systems.schedule.compiled_timetable import timetable
    from orchestration.systems.schedule.streams import Streams

    names, table = list(system.components), timetable(system, Streams(system.seed, system.streams), fixed)
    times, begins, stepped = ([np.zeros(0, dtype=np.int64)] for _ in range(3))
    count = last = 0
    while last < end and (schedule := table.next_schedule(2**15)) is not None:
        times.append(schedule.times[:-1])
        of = np.repeat(np.arange(len(schedule)), np.diff(schedule.stepped_at))
        begins.append(count + of)
        stepped.append(schedule.stepped)
        count, last = count + len(schedule), int(schedule.times[-2])
    every, rows, which = np.concatenate(times), np.concatenate(begins), np.concatenate(stepped)
    marks = {name: np.zeros(count, dtype=np.bool_) for name in Plan(system).continuous}
    for name, mark in marks.items():
        mark[rows[which == names.index(name)]] = True
        mark[:1] = True  # the initial values
    if all(mark.all() for mark in marks.values()):
        return None
    return lambda instants: {name: mark[np.searchsorted(every, instants)] for name, mark in marks.items()}


def cut_at_points(system: System, chunks: Iterator[Chunk], points: Points) -> Iterator[Chunk]:
    """The same rows and events in chunks that end at points of all components; the last one ends where it does."""
    rest = InMemory()
    """Rows not handed on yet, after the last that was"""
    done = 0
    for chunk in chunks:
        rest.take(chunk)
        whole = Chunk(columns=chunk.columns, rows=rows_of(rest), events=events_of(rest))
        known = rows_at_points(system, whole.columns, whole.rows, points)
        full = np.flatnonzero(np.all([*known.values()], axis=0)) if known else np.arange(len(whole.rows))
        if len(full) and full[-1] >= done:
            yield _until(whole, done, int(full[-1]) + 1)
            whole, done = _after(whole, int(full[-1])), 1
        rest = InMemory()
        rest.take(whole)
    for left in rest.chunks():
        if len(left.rows) > done:
            yield _until(left, done, len(left.rows))


def rows_at_points(system: System, columns: Sequence[str], rows: Floats, points: Points) -> dict[str, Booleans]:
    """Which rows are at points of their component, by output of a component in continuous time."""
    marks = points(instants_of(rows[:, 0]))
    return {name: marks[component_of(name)] for name in own_outputs(system, columns)}


def on_lines(columns: Sequence[str], rows: Floats, known: Mapping[str, Booleans]) -> Floats:
    """The rows with outputs on the lines between their `known` rows; after the last of these they stay."""
    rows = rows.copy()
    t = rows[:, 0]
    for name, at in known.items():
        column = rows[:, columns.index(name)]
        column[~at] = np.interp(t[~at], t[at], column[at])
    return rows


def _until(chunk: Chunk, begin: int, end: int) -> Chunk:
    """The rows from `begin` to before `end`, and all events up to the last of them."""
    events = chunk.events
    table = events.table[events.table[:, 0] <= instants_of(chunk.rows[end - 1 : end, 0])]
    return replace(chunk, rows=chunk.rows[begin:end], events=Events(events.names, table))


def _after(chunk: Chunk, last: int) -> Chunk:
    """The rows from `last` on, and the events after it."""
    events = chunk.events
    table = events.table[events.table[:, 0] > instants_of(chunk.rows[last : last + 1, 0])]
    return replace(chunk, rows=chunk.rows[last:], events=Events(events.names, table))
