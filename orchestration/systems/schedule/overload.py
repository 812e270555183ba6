"""Processors whose tasks ask for more time than there is: what every command says of them."""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass

from orchestration.foundation.basics.errors import UsageError
from orchestration.foundation.basics.times import seconds
from orchestration.systems.schedule.resources import timeline_of
from orchestration.systems.system.computers import Computer, Message, Task
from orchestration.systems.system.distribution import mean
from orchestration.systems.system.model import System
from orchestration.systems.system.placement import PlacedTask, placed_tasks

FULL = 1.0 + 1e-9
"""Demand up to which all jobs have time, but for rounding"""
INSTEAD = {
    "queue": "jobs of {} wait, ever more of them",
    "skip": "releases of {} before its last job is done are skipped",
    "abort": "jobs of {} that are not done at their deadline end there",
}
"""the fate of jobs that have no time, by `overrun`"""


def rate_of(of: Task | Message, clock_ratio: float, seen: float) -> float:
    """The rate [1/s]: as declared, else as `seen`."""
    if of.period is not None:
        return clock_ratio / of.period
    return seen if of.arrivals is None else of.arrivals.poisson


def demand_of(task: Task, computer: Computer, seen: float) -> float:
    """The share of the time of its processor that a task asks for on average, where its jobs are `seen` [1/s]."""
    return mean(task.execution) * rate_of(task, computer.clock_ratio, seen)


def overloads_in_words(systems: Sequence[System]) -> list[str]:
    """A warning for each processor with an overload in one of these systems, with its largest demand."""
    by_name = dict[str, list[Overload]]()
    for system in systems:
        for one in overloads(system):
            by_name.setdefault(one.name, []).append(one)
    return [worst_in_words(found, several=len(systems) > 1) for found in by_name.values()]


def worst_in_words(found: Sequence["Overload"], *, several: bool) -> str:
    """A warning about overloads of one processor, with the largest demand of `several` systems."""
    worst = max(found, key=lambda one: one.demand)
    return f"{worst.text(up_to=several)}; what is computed is of the jobs that start"


@contextmanager
def errors_name_overload(system: System) -> Iterator[None]:
    """Name an overloaded processor as the cause of `UsageError`s about the schedule in a block.

    Not of those about tasks, and their components, of another one.
    """
    try:
        yield
    except UsageError as error:
        about = {
            each.computer_name
            for each in placed_tasks(system.computers)
            if str(error).startswith((f"{each.place}:", f"components.{each.task.component}:"))
        }
        causes = [one.text() for one in overloads(system) if one.name in (about or system.computers)]
        if not causes:
            raise
        raise UsageError(f"{'; '.join(causes)}; expected at most 100 %: {error}") from error


@dataclass(frozen=True)
class Overload:
    """An overload of a processor."""

    name: str
    computer: Computer
    shares: Mapping[str, float]
    """The demand of each task, with a switch for each job"""

    @property
    def demand(self) -> float:
        """The share of its time that its tasks demand."""
        return sum(self.shares.values())

    def text(self, *, up_to: bool = False) -> str:
        """How large it is, and what becomes of the jobs."""
        switching = ", switches included" if self.computer.switch else ""
        return (
            f"computers.{self.name}: overloaded, its tasks demand {'up to ' if up_to else ''}{100.0 * self.demand:.6g} "
            f"% of its time{switching}: {'; '.join(self._instead())}"
        )

    def _instead(self) -> Iterator[str]:
        late: dict[str, list[str]] = {}
        for name, task in self.computer.tasks.items():
            above = [
                share for other, share in self.shares.items()
                if self.computer.scheduling != "fixed-priority" or self.computer.tasks[other].priority <= task.priority
            ]  # fmt: skip
            if sum(above) > FULL:
                late.setdefault(task.overrun, []).append(name)
        for overrun, names in late.items():
            yield INSTEAD[overrun].format(" and ".join(names))


def overloads(system: System) -> list[Overload]:
    """The overloads of its processors."""
    has_unknown_rates = any(each.task.on is not None for each in placed_tasks(system.computers))
    timeline = timeline_of(system) if has_unknown_rates else None

    def share(place: PlacedTask) -> float:
        seen = 0.0
        if timeline is not None:
            seen = len(timeline.jobs[f"{place.computer_name}.{place.name}"]) / seconds(timeline.stop)
        switches = place.computer.switch * rate_of(place.task, place.computer.clock_ratio, seen)
        return demand_of(place.task, place.computer, seen) + switches

    shares = dict[str, dict[str, float]]()
    for place in placed_tasks(system.computers):
        shares.setdefault(place.computer_name, {})[place.name] = share(place)
    each = [Overload(name, system.computers[name], found) for name, found in shares.items()]
    return [one for one in each if one.demand > FULL]
