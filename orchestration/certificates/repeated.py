"""What a task is dealt again and again: which of it makes a loop unstable, and bounds a certificate from above.

A task whose execution times repeat after n jobs is n tasks, each with n times the period.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any

from orchestration.basics.bisection import bisected
from orchestration.basics.errors import UsageError
from orchestration.certificates.breaking import FINE, SCAN
from orchestration.certificates.causes import EXECUTION, Cause
from orchestration.exact.loops import Loops
from orchestration.fmi.model import Model
from orchestration.stability.operating_point import deterministic
from orchestration.system.computers import Task
from orchestration.system.distribution import highest
from orchestration.system.model import System
from orchestration.system.paths import changed
from orchestration.system.placement import PlacedTask, placed_tasks
from orchestration.system.times import NANOSECONDS

LONGEST = 4
"""turns after which what is dealt repeats; a turn has as many jobs as there are in a period of the loop"""
MOST_JOBS = 64
"""after which it repeats"""
AGREE = 1e-6
"""of a radius, from order to order"""

Word = tuple[int, ...]
"""0 or 1 by turn: nothing, or the value"""


@dataclass(frozen=True, kw_only=True)
class Tried:
    """What makes a loop unstable if it comes again and again."""

    breaking: float | None = None
    """the least value [s]; None: none that was tried does"""
    sequence: tuple[tuple[str, tuple[float, ...]], ...] = ()
    """how many jobs are dealt which value"""
    searched: str


def least_repeated(system: System, cause: Cause, models: Mapping[str, Model], period: Fraction) -> Tried:
    """The least value of a cause at which something makes a loop unstable that comes again and again.

    `period` is that of the loop [ns], and `models` are by what the system calls its FMUs. All jobs of other tasks take
    the longest that they can; what else is drawn is as little as it can be.
    """
    of = next((each for each in placed_tasks(system.computers) if cause.path.startswith(f"{each.place}.")), None)
    if of is None or of.task.period is None or (of.task.component is not None and cause.key != EXECUTION):
        return Tried(searched="no sequences")
    loops, always = Loops(models), _always_most(system)
    jobs = math.ceil(period / NANOSECONDS / Fraction(repr(float(cause.period))))
    longest = 1 if of.task.component is not None else max(1, min(LONGEST, MOST_JOBS // jobs))

    words, unknown = [*_words(longest)], dict[Word, UsageError]()

    def fails(value: float, word: Word) -> bool:
        system = _dealt(always, of, cause, [value * share for share in word for _ in range(jobs)])
        try:
            return loops.radius(system, agree=AGREE) >= 1.0
        except UsageError as error:  # more than the processor can do, or a timetable that does not repeat itself
            unknown[word] = error
            return False

    good, worst, value = 0.0, None, 0.0
    for i in range(SCAN + 1):
        value = cause.period * i / SCAN
        worst = next((word for word in words if fails(value, word)), None)
        if worst is not None or len(unknown) == len(words):
            break
        good = value
    searched = (
        f"0 and a value up to {value:g} s, in sequences that repeat after at most {longest} times {jobs} jobs, "
        "as far as a timetable repeats itself"
    )
    if len(unknown) == len(words):
        searched += f": {unknown[words[0]]}"
    if worst is None:
        return Tried(searched=searched)
    least = bisected(lambda x: fails(x, worst), good, value, FINE * cause.period).bad
    sequence = tuple((f"{jobs} jobs" if jobs > 1 else "job", (least * share,)) for share in worst)
    return Tried(breaking=least, sequence=sequence, searched=searched)


def _words(longest: int) -> Iterator[Word]:
    """Those that are no other one again and again, one of each that differ in where they begin."""
    for length in range(1, longest + 1):
        for word in itertools.product((1, 0), repeat=length):
            turned = [word[i:] + word[:i] for i in range(length)]
            if any(word) and word == max(turned) and len(set(turned)) == length:
                yield word


def _always_most(system: System) -> System:
    """In which every job takes the longest that it can, and all else is punctual."""
    calm, most = deterministic(system), {}
    for name, computer in system.computers.items():
        of_calm = calm.computers[name]
        tasks = {
            key: replace(task, execution=highest(computer.tasks[key].execution)) for key, task in of_calm.tasks.items()
        }
        most[name] = replace(of_calm, tasks=tasks)
    return replace(calm, computers=most)


def _dealt(system: System, of: PlacedTask, cause: Cause, values: Sequence[float]) -> System:
    """With the jobs of a task dealt these values in turn, as tasks of their own."""
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
            offset = task.offset + _times(i, task.period)
            dealt = {"execution": value} if cause.key == EXECUTION else {"offset": offset + value}
            every: dict[str, Any] = {"period": _times(len(values), task.period), "offset": offset, "deadline": task.due}
            tasks[f"{name} {i + 1}"] = replace(task, **{**every, **dealt})
    computers = {**system.computers, of.computer_name: replace(computer, tasks=tasks)}
    return replace(system, computers=computers)


def _times(count: int, period: float) -> float:
    """So many periods, of which the decimal form is as short as that of one [s]."""
    return float(count * Fraction(repr(float(period))))
