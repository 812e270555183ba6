"""Varying quantities of a computer or a network that delays a loop, translated to draws of a `Timeline`.

Whatever the execution times are, a component samples within a window after its nominal sample, and its messages arrive
within another. A loop that no sequence of draws from these windows makes unstable is stable on that computer.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

from orchestration.foundation.basics.bisection import bisected
from orchestration.foundation.basics.errors import UsageError
from orchestration.foundation.basics.times import NANOSECONDS, exact_nanoseconds, floor_to_nanoseconds
from orchestration.systems.computers.windows import Window, windows_of
from orchestration.systems.system.distribution import Distribution, lowest
from orchestration.systems.system.distribution import Varying as Delay
from orchestration.systems.system.model import System
from orchestration.systems.system.paths import changed
from orchestration.systems.system.placement import placed_messages, placed_tasks
from orchestration.theory.certificates.breaking import FINE
from orchestration.theory.certificates.certified_loop import JITTER, LATENCY, SHIFT, CertifiedLoop, Draws, Varying
from orchestration.theory.certificates.family import LoopFamily
from orchestration.theory.certificates.timeline import LoopTimeline

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


class ScheduledLoop:
    """A loop that a computer or a network delays."""

    def __init__(self, loop: CertifiedLoop, system: System, cause: Cause) -> None:
        """`loop` is that of the components of `system` without delays.

        Raises `UsageError` where there is no bound of their lateness, where a message may arrive after the next sample,
        and for more than one delayed component.
        """
        self._loop, self._system, self._cause = loop, system, cause
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
        timeline = LoopTimeline(replace(self._loop, system=self._earliest_system(windows)), self._varying(windows))
        largest_sum = [window.together / NANOSECONDS for window in windows.values() if not window.is_certain]
        return timeline, _widths(windows), largest_sum[0] if largest_sum else None

    def _draws(self, value: float) -> Draws:
        """The draws up to a value [s], of which the family takes long; raises `UsageError` where they are refused."""
        timeline, largest, largest_sum = self._timeline(value)
        return timeline.draws(largest, largest_sum)

    def largest(self) -> float:
        """The largest value for which there is a family [s]."""
        largest = self._last(self._draws)
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
                widths = _widths(self._windows(value))
            except UsageError:
                return True
            return len(widths) > len(most) or (len(widths) == len(most) and any(a > b for a, b in zip(widths, most)))

        found = bisected(fails, 0.0, self._cause.period, 0.5 / NANOSECONDS).good or 0.0
        return min(floor_to_nanoseconds(found), self.largest())

    def _windows(self, value: float) -> dict[str, Window]:
        windows = windows_of(self._cause.with_draws_up_to(self._system, value))
        late = [name for name, window in windows.items() if not window.is_certain]
        if len(late) > 1:
            raise UsageError(
                f"{self._cause.path}: delays {', '.join(late)}; expected one delayed component, other tasks as load"
            )
        return windows

    def _varying(self, windows: Mapping[str, Window]) -> list[Varying]:
        path = self._cause.path
        return [
            Varying(kind=kind, name=name, path=path)
            for name, window in windows.items()
            for kind in _draw_widths(window)
        ]

    def _earliest_system(self, windows: Mapping[str, Window]) -> System:
        """The system of the loop, each component and message as early as possible."""
        components = dict(self._loop.system.components)
        for name, window in windows.items():
            of_loop, task = components[name].sampling, self._system.components[name].sampling
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


def _draw_widths(window: Window) -> dict[str, int]:
    """The kinds of draws of a window, each from 0 to a width [ns]."""
    shift = SHIFT if window.at_deadline else JITTER
    widths = {shift: window.shift, LATENCY: window.spread}
    return {kind: width for kind, width in widths.items() if width}


def _widths(windows: Mapping[str, Window]) -> list[float]:
    """The widths of all draws [s]."""
    return [width / NANOSECONDS for window in windows.values() for width in _draw_widths(window).values()]
