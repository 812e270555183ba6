"""Computers and networks as data: the tasks that share a processor, the messages that share a bus."""

from collections.abc import Mapping
from dataclasses import field
from typing import Any

from orchestration.foundation.basics.errors import shown
from orchestration.foundation.basics.records import record
from orchestration.foundation.basics.times import NANOSECONDS, is_at_least, nanoseconds, seconds
from orchestration.systems.system.choices import NetworkKind, Overrun, Read, Scheduling, Stuffing, Write
from orchestration.systems.system.distribution import Varying, highest, is_random, reads_file, require_varying, spreads
from orchestration.systems.system.requirements import (
    is_finite,
    require,
    require_not_negative,
    require_positive,
)


@record()
class Arrivals:
    """Random arrivals, in place of a period."""

    poisson: float
    """The mean number of arrivals per second; the gaps between them are exponentially distributed."""

    def __post_init__(self) -> None:
        require_positive(self, "poisson")
        require(self.poisson <= NANOSECONDS, "poisson", self.poisson, "at most one a nanosecond")

    @property
    def gap(self) -> float:
        """The mean gap between arrivals [s]."""
        return 1.0 / self.poisson


@record()
class Task:
    """A task of a computer: the steps of a component, or load. Times in seconds.

    It is released every `period`, by random `arrivals`, or `on` the messages of a connection.
    """

    component: str | None = None
    """The component whose steps are its jobs, which has neither `sampling` nor `step` then; default: none, for load."""
    period: float | None = None
    """The time T from one release to the next [s], in the computer's time: release k is at offset + kT."""
    offset: float = 0.0
    """The time of the first release [s], in the computer's time."""
    jitter: Varying = 0.0
    """The largest lateness J of a release [s], drawn for each, or the distribution of the lateness itself; it is less
    than the period."""
    arrivals: Arrivals | None = None
    """Random releases, in place of a period."""
    on: str | None = None
    """The connection whose arriving messages release it, in place of a period."""
    priority: int = 1
    """The priority: 1 is more urgent than 2; equal ones by release, then by their order in the file."""
    execution: Varying = 0.0
    """The processor time that a job takes [s], or its distribution."""
    deadline: float | None = None
    """The time from the nominal release to when a job should be done [s]; default: the period, or the mean time between
    arrivals."""
    read: Read = "start"
    """The time at which it reads its inputs: when the job starts (start), or at its release."""
    write: Write = "end"
    """The time at which it sends its outputs: when the job is done (end), or at its deadline (logical execution
    time)."""
    overrun: Overrun = "queue"
    """The treatment of a release while a job is not done: it waits (queue), or makes no job (skip); or the late job is
    ended at its deadline without output (abort)."""

    @property
    def due(self) -> float:
        """The deadline in effect [s]."""
        return _due(self)

    @property
    def is_random(self) -> bool:
        """Whether the seed changes its jobs."""
        return spreads(self.jitter) or self.arrivals is not None or is_random(self.execution)

    def __post_init__(self) -> None:
        _expect_releases(self, "period, arrivals or on")
        require_varying(self, "execution")
        require(self.on is None or self.deadline is not None, "deadline", "none", "one, for a task that has no period")
        if self.deadline is not None:
            require_positive(self, "deadline")
        require(is_at_least(self.due, 1.0), "deadline", self.due, "at least a nanosecond")


@record()
class Computer:
    """A processor and the tasks that share it."""

    scheduling: Scheduling = "fixed-priority"
    """The choice of the waiting job that runs: that of the most urgent priority, of the earliest deadline, or the one
    that came first."""
    preemptive: bool = True
    """Whether a job of higher rank preempts the one that runs."""
    switch: float = 0.0
    """The overhead of starting or resuming a job [s]."""
    clock_ratio: float = 1.0
    """The seconds r that the computer believes pass per true second."""
    tasks: Mapping[str, Task] = field(default_factory=dict)
    """The tasks by name; their order decides ties."""

    def __post_init__(self) -> None:
        require_not_negative(self, "switch")
        require_positive(self, "clock_ratio")
        for name, task in self.tasks.items():
            if task.period is None:
                continue
            place = f"tasks.{name}."
            require(is_at_least(task.period, self.clock_ratio), f"{place}period", task.period, "at least a nanosecond")
            if not reads_file(task.jitter):
                require_less(f"{place}jitter", task.jitter, task.period / self.clock_ratio)


@record()
class Message:
    """The messages of a connection over a network, or load. Times in seconds."""

    connection: str | None = None
    """The connection whose messages these are, sent when its sender writes; default: none, for load."""
    bytes: int
    """The length of its data."""
    identifier: int | None = None
    """The identifier of CAN, of 11 bits; the lowest is sent first."""
    slot: int | None = None
    """The slot of TDMA: that of the cycle in which it is sent, counted from 0."""
    priority: int = 1
    """The priority of Ethernet; 1 is more urgent than 2."""
    start: str | None = None
    """The sending node of Ethernet (`from` in files); default for a connection: the computer of its sender, or the
    sender itself."""
    end: str | None = None
    """The receiving node of Ethernet (`to` in files); default for a connection: the computer of its receiver, or the
    receiver itself."""
    period: float | None = None
    """The time from one message to the next [s]: of load, and of a connection from a component in continuous time."""
    offset: float = 0.0
    """The time of the first message [s]."""
    jitter: Varying = 0.0
    """The largest lateness J of a message [s], drawn for each, or the distribution of the lateness itself; it is less
    than the period."""
    arrivals: Arrivals | None = None
    """Random arrivals, in place of a period."""
    deadline: float | None = None
    """The time in which a message should be received [s]; default: the period or the mean time between arrivals, if it
    has one."""

    @property
    def is_random(self) -> bool:
        """Whether the seed changes when it is queued."""
        return spreads(self.jitter) or self.arrivals is not None

    @property
    def due(self) -> float | None:
        """The deadline in effect [s]."""
        return _due(self) if self.deadline or self.period or self.arrivals else None

    def __post_init__(self) -> None:
        require(self.bytes >= 0, "bytes", self.bytes, "0 or more")
        if self.connection is None:
            _expect_releases(self, "period or arrivals")
        elif self.period is not None or self.arrivals is not None:
            _expect_releases(self, "a period")
        if self.period is not None:
            require(is_at_least(self.period, 1.0), "period", self.period, "at least a nanosecond")
            if not reads_file(self.jitter):
                require_less("jitter", self.jitter, self.period)
        if self.deadline is not None:
            require_positive(self, "deadline")


@record()
class Network:
    """A bus or a switch, and the messages that share it."""

    kind: NetworkKind
    """The kind of network."""
    bit_rate: float
    """Bits per second."""
    data_bit_rate: float | None = None
    """The bits per second in the data phase of a frame of CAN FD."""
    stuffing: Stuffing = "longest"
    """The number of stuff bits of a frame of CAN: the largest possible (longest), or none."""
    slots: tuple[float, ...] = ()
    """The lengths of the slots of a cycle of TDMA [s]."""
    latency: float = 0.0
    """The latency of Ethernet: the time in the switch from the last bit in until a frame can go out [s]."""
    error: float = 0.0
    """The probability that a frame is corrupted, and sent again."""
    messages: Mapping[str, Message] = field(default_factory=dict)
    """The messages by name; their order decides ties."""

    def __post_init__(self) -> None:
        require_positive(self, "bit_rate")
        require_not_negative(self, "latency")
        fits = is_finite(self.error) and 0.0 <= self.error < 1.0
        require(fits, "error", self.error, "a probability in [0, 1): a frame that is always corrupted never arrives")
        self._expect_only_with("data_bit_rate", self.data_bit_rate is None, "can-fd")
        self._expect_only_with("slots", not self.slots, "tdma")
        self._expect_only_with("latency", self.latency == 0.0, "ethernet")
        if self.kind == "can-fd":
            require(self.data_bit_rate is not None, "data_bit_rate", "none", "bits a second, for can-fd")
            require_positive(self, "data_bit_rate")
        if self.kind == "tdma":
            require(len(self.slots) > 0, "slots", "none", "the lengths of the slots of a cycle, for tdma")
        for length in self.slots:
            fits = is_finite(length) and length > 0.0 and is_at_least(length, 1.0)
            require(fits, "slots", length, "at least a nanosecond each")
        self._expect_messages()

    def _expect_only_with(self, name: str, is_absent: bool, kind: str) -> None:
        require(is_absent or self.kind == kind, name, getattr(self, name), f"none but with kind {kind}")

    def _expect_messages(self) -> None:
        from orchestration.systems.system.frames import frame_nanoseconds  # which knows these records

        can, seen = self.kind in ("can", "can-fd"), dict[int, str]()
        for name, message in self.messages.items():
            place = f"messages.{name}."
            if can:
                number = message.identifier
                fits = number is not None and 0 <= number < 2**11
                require(fits, f"{place}identifier", number, "a number of 11 bits, which CAN needs")
                assert number is not None
                free = f"another one than {seen.get(number)} has"
                require(number not in seen, f"{place}identifier", number, free)
                seen[number] = name
                most = 8 if self.kind == "can" else 64
                require(message.bytes <= most, f"{place}bytes", message.bytes, f"at most {most} with kind {self.kind}")
            if self.kind == "tdma":
                slot, count = message.slot, len(self.slots)
                fits = slot is not None and 0 <= slot < count
                require(fits, f"{place}slot", slot, f"a slot from 0 to {count - 1}")
            if self.kind == "ethernet" and message.connection is None:
                for key, node in (("from", message.start), ("to", message.end)):
                    require(node is not None, f"{place}{key}", "none", "a node")
            length = frame_nanoseconds(self, message)
            require(length >= 1, f"{place}bytes", message.bytes, "a frame of a nanosecond or longer")
            if self.kind == "tdma" and message.slot is not None:
                room = nanoseconds(self.slots[message.slot])
                require(length <= room, f"{place}bytes", message.bytes, f"a frame that fits into {seconds(room):g} s")


def _expect_releases(of: Any, ways: str) -> None:
    given = [key for key in ("period", "arrivals", "on") if getattr(of, key, None) is not None]
    require(len(given) == 1, "period", " and ".join(given) or "none", f"one of {ways}")
    require_not_negative(of, "offset")
    require_varying(of, "jitter")
    if of.period is not None:
        require_positive(of, "period")
    else:
        require(of.jitter == 0.0, "jitter", of.jitter, "0 without a period")
    if getattr(of, "on", None) is not None:
        require(of.offset == 0.0, "offset", of.offset, "0 for a task that messages release")


def require_less(place: str, jitter: Varying, period: float) -> None:
    """Raise `UsageError` for a lateness of a `period` [s] or more."""
    require(highest(jitter) < period, place, highest(jitter), f"less than the period of {shown(period)} s")


def _due(of: Any) -> float:
    found = of.deadline or of.period or (of.arrivals.gap if of.arrivals is not None else 0.0)
    return float(found)
