"""Repeated values of a task that make a loop unstable, and so bound certificates from above.

A task whose execution times repeat after n jobs is equivalent to n tasks, each with n times the period.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any

from orchestration.components.fmi.read_description import Model
from orchestration.foundation.basics.bisection import bisected
from orchestration.foundation.basics.errors import UsageError
from orchestration.foundation.basics.times import NANOSECONDS
from orchestration.foundation.basics.unit_algebra import quantity
from orchestration.foundation.processes.passable import passable
from orchestration.systems.system.computers import Task
from orchestration.systems.system.distribution import highest
from orchestration.systems.system.model import System
from orchestration.systems.system.paths import changed
from orchestration.systems.system.placement import PlacedTask, placed_tasks
from orchestration.theory.certificates.breaking import FINE, SCAN
from orchestration.theory.certificates.causes import EXECUTION, Cause
from orchestration.theory.exact.examined_limit import RADIUS_TOLERANCE
from orchestration.theory.exact.loops import Loops
from orchestration.theory.stability.delay_bounds import patterns
from orchestration.theory.stability.operating_point import deterministic

MAX_TURNS = 4
"""turns after which a sequence repeats; a turn has as many jobs as there are in a period of the loop"""
MAX_SEQUENCE_JOBS = 64
"""Most jobs after which a sequence repeats"""

NOT_SEARCHED = "no sequences"

Word = tuple[int, ...]
"""Choices by turn, 0 or 1: nothing, or the value"""


@passable
@dataclass(frozen=True, kw_only=True)
class RepeatedSearch:
    """A repeated sequence that makes a loop unstable, if one was found."""

    breaking: float | None = None
    """the least value [s]; None: none that was tried does"""
    sequence: tuple[tuple[str, tuple[float, ...]], ...] = ()
    """numbers of jobs, with their value"""
    searched: str
    last: float | None = None
    """the largest value that was tried [s]; None: none was"""


def least_repeated(system: System, cause: Cause, models: Mapping[str, Model], period: Fraction) -> RepeatedSearch:
    """The least value of a cause at which a repeated sequence makes a loop unstable.

    `period` is that of the loop [ns], and `models` are by the names of FMUs in the system. All jobs of other tasks take
    their longest execution times; all other draws are the least.
    """
    of = next((each for each in placed_tasks(system.computers) if cause.path.startswith(f"{each.place}.")), None)
    if of is None or of.task.period is None or (of.task.component is not None and cause.key != EXECUTION):
        return RepeatedSearch(searched=NOT_SEARCHED)
    loops, always = Loops(models), _with_longest_jobs(system)
    jobs = math.ceil(period / NANOSECONDS / Fraction(repr(float(cause.period))))
    longest = 1 if of.task.component is not None else max(1, min(MAX_TURNS, MAX_SEQUENCE_JOBS // jobs))

    words, unknown = (
        sorted(patterns(longest), key=lambda word: (len(word), [-share for share in word])),
        dict[Word, UsageError](),
    )

    def fails(value: float, word: Word) -> bool:
        system = _with_repeated(always, of, cause, [value * share for share in word for _ in range(jobs)])
        try:
            return loops.radius(system, agree=RADIUS_TOLERANCE) >= 1.0
        except UsageError as error:  # an overloaded processor, or a timetable that does not repeat
            unknown[word] = error
            return False

    good, worst, value = 0.0, None, 0.0
    for i in range(SCAN + 1):
        value = cause.period * i / SCAN
        worst = next((word for word in words if fails(value, word)), None)
        if worst is not None or len(unknown) == len(words):
            break
        good = value
    turns = f"in turns of {jobs} jobs, each 0 or the value, that repeat after at most {longest} turns"
    searched = f"{turns if longest > 1 else 'the same value for all jobs'}: "
    searched += f"values from 0 to {quantity(good if worst is None else value, 's')} in steps of "
    searched += quantity(cause.period / SCAN, "s")
    if len(unknown) == len(words):
        searched += f"; at {quantity(value, 's')} {unknown[words[0]]}"
    elif unknown:
        searched += f"; without {len(unknown)} of {len(words)}: {next(iter(unknown.values()))}"
    if worst is None:
        return RepeatedSearch(searched=searched, last=good)
    least = bisected(lambda x: fails(x, worst), good, value, FINE * cause.period).bad
    sequence = tuple((f"{jobs} jobs" if jobs > 1 else "job", (least * share,)) for share in worst)
    return RepeatedSearch(breaking=least, sequence=sequence, searched=searched, last=least)


def _with_longest_jobs(system: System) -> System:
    """The system in which every job takes its longest time, without jitter."""
    punctual, most = deterministic(system), {}
    for name, computer in system.computers.items():
        without_jitter = punctual.computers[name]
        tasks = {
            key: replace(task, execution=highest(computer.tasks[key].execution))
            for key, task in without_jitter.tasks.items()
        }
        most[name] = replace(without_jitter, tasks=tasks)
    return replace(punctual, computers=most)


def _with_repeated(system: System, of: PlacedTask, cause: Cause, values: Sequence[float]) -> System:
    """The system with these values for the jobs of a task in turn, as separate tasks."""
    if of.task.component is not None:
        return changed(system, {cause.path: values[0]})
    computer = system.computers[of.computer_name]
    tasks: dict[str, Task] = {}
    for name, task in computer.tasks.items():
        if name != of.name:
            tasks[name] = task
            continue
        assert task.period is not None
        for i, value in enumerate(values):
            offset = task.offset + _multiple(i, task.period)
            varied = {"execution": value} if cause.key == EXECUTION else {"offset": offset + value}
            every: dict[str, Any] = {
                "period": _multiple(len(values), task.period),
                "offset": offset,
                "deadline": task.due,
            }
            tasks[f"{name} {i + 1}"] = replace(task, **{**every, **varied})
    computers = {**system.computers, of.computer_name: replace(computer, tasks=tasks)}
    return replace(system, computers=computers)


def _multiple(count: int, period: float) -> float:
    """A number of periods [s], whose decimal form is as short as that of one."""
    return float(count * Fraction(repr(float(period))))
