"""A computer or a network that makes a loop late: what of it varies, translated to draws of a `Timeline`.

Whatever the scheduler is dealt, a component samples within a window after its nominal sample, and its messages arrive
within another. A loop that no sequence of draws from these windows makes unstable is stable on that computer.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

from orchestration.basics.bisection import bisected
from orchestration.basics.errors import UsageError
from orchestration.certificates.breaking import FINE
from orchestration.certificates.family import Family
from orchestration.certificates.parts import Loop
from orchestration.certificates.timeline import JITTER, LATENCY, START, Timeline, Varying
from orchestration.computers.windows import Window, windows_of
from orchestration.system.distribution import Distribution, lowest
from orchestration.system.distribution import Varying as Delay
from orchestration.system.model import System
from orchestration.system.paths import changed
from orchestration.system.placement import placed_messages, placed_tasks
from orchestration.system.times import NANOSECONDS, down_to_nanoseconds, exact_nanoseconds

EXECUTION = "execution"


@dataclass(frozen=True, kw_only=True)
class Cause:
    """The execution time of a task, or the jitter of a task or of a message: each draw is from 0 to a value."""

    key: str
    path: str
    period: float
    """of that task or message [s], which the value is less than"""

    def up_to(self, system: System, value: float) -> System:
        """With draws up to a value [s]."""
        spread = self.key == EXECUTION and value > 0.0
        return changed(system, {self.path: Distribution(uniform=(0.0, value)) if spread else value})


def cause_at(system: System, path: str) -> Cause | None:
    """What a path is of; None: no execution time and no jitter of what shares something."""
    for task in placed_tasks(system.computers):
        if path in (f"{task.place}.{EXECUTION}", f"{task.place}.jitter"):
            return Cause(key=path.rpartition(".")[2], path=path, period=task.task.period or task.task.due)
    for message in placed_messages(system.networks):
        if path == f"{message.place}.jitter":
            return Cause(key="jitter", path=path, period=message.message.period or message.message.due or 0.0)
    return None


class Caused:
    """A loop that a computer or a network makes late."""

    def __init__(self, loop: Loop, system: System, cause: Cause) -> None:
        """`loop` is that of the components of `system` if nothing made them late.

        Raises `UsageError` where theory has no bound of how late they are, where a message may arrive after the next
        sample, and for more than one component that is late.
        """
        self._loop, self._system, self._cause = loop, system, cause
        self.family(0.0)

    def family(self, value: float) -> Family:
        """With draws up to a value [s]; raises `UsageError` as above."""
        windows = self._windows(value)
        timeline = Timeline(replace(self._loop, system=self._by_the_least(windows)), self._varying(windows))
        together = [window.together / NANOSECONDS for window in windows.values() if not window.is_certain]
        return timeline.family(_widths(windows), together=together[0] if together else None)

    def largest(self) -> float:
        """The largest value for which there is a family [s]."""

        def fails(value: float) -> bool:
            try:
                self.family(value)
            except UsageError:
                return True
            return False

        return down_to_nanoseconds(bisected(fails, 0.0, self._cause.period, FINE * self._cause.period).good or 0.0)

    def value_of(self, family: Family) -> float:
        """The largest value of which the windows are no wider than those of a family [s]."""
        most = family.largest()

        def fails(value: float) -> bool:
            try:
                own = _widths(self._windows(value))
            except UsageError:
                return True
            return len(own) > len(most) or (len(own) == len(most) and any(a > b for a, b in zip(own, most)))

        found = bisected(fails, 0.0, self._cause.period, 0.5 / NANOSECONDS).good or 0.0
        return min(down_to_nanoseconds(found), self.largest())

    def _windows(self, value: float) -> dict[str, Window]:
        windows = windows_of(self._cause.up_to(self._system, value))
        late = [name for name, window in windows.items() if not window.is_certain]
        if len(late) > 1:
            raise UsageError(
                f"{self._cause.path}: makes {', '.join(late)} late; expected one component that is, the tasks of "
                "others as load"
            )
        return windows

    def _varying(self, windows: Mapping[str, Window]) -> list[Varying]:
        path = self._cause.path
        return [Varying(kind=kind, name=name, path=path) for name, window in windows.items() for kind in _drawn(window)]

    def _by_the_least(self, windows: Mapping[str, Window]) -> System:
        """The system of the loop, each component and message as early as it can be."""
        components = dict(self._loop.system.components)
        for name, window in windows.items():
            of_loop, task = components[name].sampling, self._system.components[name].sampling
            assert of_loop is not None
            assert task is not None
            offset = task.offset + window.earliest / NANOSECONDS * task.clock_ratio
            components[name] = replace(components[name], sampling=replace(of_loop, offset=offset, jitter=0.0))
        connections = tuple(
            replace(x, delay=_longer(x.delay, windows[x.sender])) if x.sender in windows else x
            for x in self._loop.system.connections
        )
        return replace(self._loop.system, components=components, connections=connections)


def _longer(delay: Delay, window: Window) -> float:
    """With the least that lies between a sample that is as early as it can be and its messages [s]."""
    least = window.least - (window.earliest if window.at_deadline else 0)
    return float(exact_nanoseconds(lowest(delay)) + least) / NANOSECONDS


def _drawn(window: Window) -> dict[str, int]:
    """What of a window is drawn, from 0 to how much [ns]."""
    shift = START if window.at_deadline else JITTER
    widths = {shift: window.shift, LATENCY: window.spread}
    return {kind: width for kind, width in widths.items() if width}


def _widths(windows: Mapping[str, Window]) -> list[float]:
    """Of all that is drawn [s]."""
    return [width / NANOSECONDS for window in windows.values() for width in _drawn(window).values()]
