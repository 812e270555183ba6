"""Varying quantities of a computer or a network that delays a loop, translated to draws of a `Timeline`.

Whatever the execution times are, a component samples within a window after its nominal sample, and its messages arrive
within another. A loop that no sequence of draws from these windows makes unstable is stable on that computer.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from orchestration.foundation.basics.bisection import bisected
from orchestration.foundation.basics.errors import UsageError
from orchestration.foundation.basics.times import NANOSECONDS, exact_nanoseconds, floor_to_nanoseconds
from orchestration.systems.computers.windows import Window, windows_of
from orchestration.systems.system.component import Component, Sampling
from orchestration.systems.system.connection import Connection
from orchestration.systems.system.distribution import Distribution, lowest
from orchestration.systems.system.distribution import Varying as Delay
from orchestration.systems.system.model import System
from orchestration.systems.system.paths import changed
from orchestration.systems.system.placement import messages_by_connection, placed_messages, placed_tasks
from orchestration.theory.certificates.breaking import FINE
from orchestration.theory.certificates.certified_loop import JITTER, LATENCY, SHIFT, CertifiedLoop, Varying
from orchestration.theory.certificates.family import LoopFamily
from orchestration.theory.certificates.timeline import LoopTimeline
from orchestration.theory.stability.matrices import SampledSystem

EXECUTION = "execution"


@dataclass(frozen=True, kw_only=True)
class Cause:
    """The execution time of a task, or the jitter of a task or of a message: each draw is from 0 to a value."""

    key: str
    path: str
    period: float
    """Period of that task or message [s]; the value is less"""

    def with_draws_up_to(self, system: System, value: float) -> System:
        """The system with draws up to a value [s]."""
        spread = self.key == EXECUTION and value > 0.0
        return changed(system, {self.path: Distribution(uniform=(0.0, value)) if spread else value})


def cause_at(system: System, path: str) -> Cause | None:
    """The cause at a path; None: it is no execution time and no jitter of a task or message."""
    for task in placed_tasks(system.computers):
        if path in (f"{task.place}.{EXECUTION}", f"{task.place}.jitter"):
            return Cause(key=path.rpartition(".")[2], path=path, period=task.task.period or task.task.due)
    for message in placed_messages(system.networks):
        if path == f"{message.place}.jitter":
            return Cause(key="jitter", path=path, period=message.message.period or message.message.due or 0.0)
    return None


def sampled_by_networks(loop: CertifiedLoop, system: System) -> CertifiedLoop:
    """A loop with what networks sample of components in continuous time as sampled components that send it on."""
    components, parts, connections = dict(loop.system.components), dict(loop.components), list[Connection]()
    over = messages_by_connection(system)
    for x in loop.system.connections:
        if x.name not in over or loop.is_sampled(x.sender):
            connections.append(x)
            continue
        place, message = _in_one(over[x.name].place), over[x.name].message
        assert message.period is not None
        components[place] = Component(fmu="", sampling=Sampling(period=message.period, offset=message.offset))
        names = tuple(map(str, range(len(x.start))))
        nothing, copy = np.zeros((0, 0)), np.eye(len(names))
        parts[place] = SampledSystem(
            inputs=names, outputs=names, A=nothing, B=np.zeros((0, len(names))), C=np.zeros((len(names), 0)), D=copy
        )
        ends = tuple(f"{place}.{name}" for name in names)
        connections += [Connection(name=place, start=x.start, end=ends), replace(x, start=ends)]
    return replace(
        loop, system=replace(loop.system, components=components, connections=tuple(connections)), components=parts
    )


def _in_one(place: str) -> str:
    """The name of what a message samples for it, as of a component."""
    return place.replace(".", "/")


class ScheduledLoop:
    """A loop that a computer or a network delays."""

    def __init__(self, loop: CertifiedLoop, system: System, cause: Cause) -> None:
        """`loop` is that of the components of `system` without delays.

        Raises `UsageError` where there is no bound of their lateness, where a message may arrive after the next sample,
        and where more than two times vary at once.
        """
        self._loop, self._system, self._cause = sampled_by_networks(loop, system), system, cause
        try:
            self.family(0.0)
        except UsageError as error:
            raise UsageError(
                f"{error}; so it is at 0 s, too, and no value has a proof: limit --of {cause.path} flies it"
            ) from error

    @property
    def tolerance(self) -> float:
        """That of the largest value [s]."""
        return FINE * self._cause.period

    def family(self, value: float) -> LoopFamily:
        """The family for draws up to a value [s]; raises `UsageError` as above."""
        timeline, largest, largest_sum = self._timeline(value)
        return timeline.family(largest, largest_sum=largest_sum)

    def _timeline(self, value: float) -> tuple[LoopTimeline, list[float], float | None]:
        """The timeline, and the largest draws and their largest sum."""
        windows = self._windows(value)
        loop, draws = replace(self._loop, system=self._earliest_system(windows)), self._draws(windows)
        varying = [Varying(kind=kind, name=name, path=self._cause.path) for (kind, name) in draws]
        sums = [windows[name].together / NANOSECONDS for kind, name in draws if kind == LATENCY]
        return LoopTimeline(loop, varying, self._latest(windows)), list(draws.values()), max(sums, default=None)

    def _pieces(self, value: float) -> object:
        """What is drawn up to a value [s], of which the family takes long; raises `UsageError` where it is refused."""
        timeline, largest, largest_sum = self._timeline(value)
        return timeline.pieces(largest, largest_sum)

    def largest(self) -> float:
        """The largest value for which there is a family [s]."""
        largest = self._last(self._pieces)
        return largest if not self.refusal(largest) else self._last(self.family)

    def _last(self, of: Callable[[float], object]) -> float:
        """The largest value that is not refused [s]."""

        def fails(value: float) -> bool:
            return bool(self.refusal(value, of))

        return floor_to_nanoseconds(bisected(fails, 0.0, self._cause.period, self.tolerance).good or 0.0)

    def refusal(self, value: float, of: Callable[[float], object] | None = None) -> str:
        """Why there is no family for draws up to a value [s]; empty where there is one."""
        try:
            (of or self.family)(value)
        except UsageError as error:
            return str(error).removeprefix(f"{self._cause.path}: ")
        return ""

    def value_of(self, family: LoopFamily) -> float:
        """The largest value [s] whose windows are no wider than those of a family."""
        most = family.largest()

        def fails(value: float) -> bool:
            try:
                widths = list(self._draws(self._windows(value)).values())
            except UsageError:
                return True
            return len(widths) > len(most) or (len(widths) == len(most) and any(a > b for a, b in zip(widths, most)))

        def reads_more(value: float) -> bool:
            return len(self.family(value).letters) > len(family.letters)

        found = bisected(fails, 0.0, self._cause.period, 0.5 / NANOSECONDS).good or 0.0
        found = min(floor_to_nanoseconds(found), self.largest())
        if not reads_more(found):
            return found
        return floor_to_nanoseconds(bisected(reads_more, 0.0, found, 0.5 / NANOSECONDS).good or 0.0)

    def _windows(self, value: float) -> dict[str, Window]:
        found = windows_of(self._cause.with_draws_up_to(self._system, value))
        return {_in_one(name): window for name, window in found.items()}

    def _draws(self, windows: Mapping[str, Window]) -> dict[tuple[str, str], float]:
        """The widths of all draws [s], each from 0, by kind and name."""
        found: dict[tuple[str, str], float] = {}
        for name, window in windows.items():
            kinds = {SHIFT if window.at_deadline else JITTER: window.shift}
            if any(x.sender == name and not self._loop.is_sampled(x.receiver) for x in self._loop.system.connections):
                kinds[LATENCY] = window.spread
            found |= {(kind, name): width / NANOSECONDS for kind, width in kinds.items() if width}
        return found

    def _latest(self, windows: Mapping[str, Window]) -> dict[str, int]:
        """By connection between sampled components, where it varies: the latest arrival after an earliest sample [ns].

        The receiver only notices which message was the last one at its sample.
        """
        return {
            x.name: math.ceil(window.end - window.earliest + exact_nanoseconds(lowest(x.delay)))
            for x in self._loop.system.connections
            for window in ([windows[x.sender]] if x.sender in windows else [])
            if window.spread and self._loop.is_sampled(x.receiver)
        }

    def _earliest_system(self, windows: Mapping[str, Window]) -> System:
        """The system of the loop, each component and message as early as possible."""
        components = dict(self._loop.system.components)
        for name, window in windows.items():
            of_loop = components[name].sampling
            task = self._system.components[name].sampling if name in self._system.components else of_loop
            assert of_loop is not None
            assert task is not None
            offset = task.offset + window.earliest / NANOSECONDS * task.clock_ratio
            components[name] = replace(components[name], sampling=replace(of_loop, offset=offset, jitter=0.0))
        connections = tuple(
            replace(x, delay=_least_delay(x.delay, windows[x.sender])) if x.sender in windows else x
            for x in self._loop.system.connections
        )
        return replace(self._loop.system, components=components, connections=connections)


def _least_delay(delay: Delay, window: Window) -> float:
    """The delay plus the least time between an earliest sample and its messages [s]."""
    least = window.least - (window.earliest if window.at_deadline else 0)
    return float(exact_nanoseconds(lowest(delay)) + least) / NANOSECONDS
