"""What happens when as arrays, some thousand instants at a time: what a loop without Python reads."""

from dataclasses import dataclass

import numpy as np

from orchestration.errors import UsageError
from orchestration.master.agenda import Agenda, Instant, Message
from orchestration.master.recording import Integers


@dataclass(frozen=True, kw_only=True)
class Schedule:
    """Instants that follow each other; of what happens at instant i, the part from `…_at[i]` to `…_at[i + 1]`."""

    times: Integers
    """[ns], shape (n + 1,): the last one is the time of the instant after these"""
    halts: Integers
    """components in continuous time, in the order in which they are stepped"""
    halts_at: Integers
    posted: Integers
    """messages, shape (m, 4): connection, k, sent [ns], arrival [ns], which is -1 for one that is lost"""
    posted_at: Integers
    measured: Integers
    measured_at: Integers
    arrivals: Integers
    arrivals_at: Integers
    dues: Integers
    """shape (m, 5): component, time of its next sample [ns], and where in `exchanged` what it receives begins, what it
    sends begins, and that ends"""
    dues_at: Integers
    exchanged: Integers
    """messages that samples read and send"""

    def __len__(self) -> int:
        return len(self.times) - 1

    def most_events(self) -> int:
        """More than any instant has."""
        exchanged = np.append(self.dues[:, 2], len(self.exchanged))[self.dues_at]
        counts = 2 * np.diff(self.posted_at + exchanged) + np.diff(self.arrivals_at + self.posted_at + exchanged)
        return int(counts.max(initial=0)) + 1

    def of(self, connection: int, begin: int, table: str) -> tuple[int, list[int]]:
        """Of a connection, whose messages take their values as `table` has them, those from instant `begin` on.

        How many they are, and which of them are kept until they arrive.
        """
        if table != "exchanged":
            messages = getattr(self, table)[getattr(self, f"{table}_at")[begin] :]
            messages = messages[messages[:, 0] == connection]
            return len(messages), messages[messages[:, 3] >= 0, 1].tolist()
        dues = self.dues[self.dues_at[begin] :]
        if not len(dues):
            return 0, []
        messages = self.exchanged[dues[0, 2] :]
        times = np.repeat(self.times[:-1], np.diff(self.dues_at))[self.dues_at[begin] :]
        sampled = np.repeat(times, dues[:, 4] - dues[:, 2])
        which = messages[:, 0] == connection
        kept = which & (messages[:, 3] >= 0) & (messages[:, 3] != sampled)
        return int(which.sum()), messages[kept, 1].tolist()


class Schedules:
    """The schedules of one run, in order, made from its agenda."""

    def __init__(self, agenda: Agenda) -> None:
        self._agenda = agenda
        self.error: UsageError | None = None
        """why there are no more instants before the end; to be raised when those before it are past"""

    def following(self, most: int) -> Schedule | None:
        """The next instants, at most so many; None at the end."""
        instants: list[Instant] = []
        try:
            for instant in self._agenda:
                instants.append(instant)
                if len(instants) == most:
                    break
        except UsageError as error:
            self.error = error
        return _of(instants, self._agenda.next_time()) if instants else None


def _of(instants: list[Instant], end: int) -> Schedule:
    dues: list[tuple[int, ...]] = []
    exchanged: list[Message] = []
    for instant in instants:
        for due in instant.due:
            begin, middle = len(exchanged), len(exchanged) + len(due.received)
            exchanged += due.received
            exchanged += due.sent
            dues.append((due.component, due.next_time, begin, middle, len(exchanged)))
    return Schedule(
        times=np.array([*(instant.time for instant in instants), end], dtype=np.int64),
        halts=np.array([index for instant in instants for index in instant.halts], dtype=np.int64),
        halts_at=_ends([len(instant.halts) for instant in instants]),
        posted=_messages([message for instant in instants for message in instant.posted]),
        posted_at=_ends([len(instant.posted) for instant in instants]),
        measured=_messages([message for instant in instants for message in instant.measured]),
        measured_at=_ends([len(instant.measured) for instant in instants]),
        arrivals=_messages([message for instant in instants for message in instant.arrivals]),
        arrivals_at=_ends([len(instant.arrivals) for instant in instants]),
        dues=np.array(dues, dtype=np.int64).reshape(-1, 5),
        dues_at=_ends([len(instant.due) for instant in instants]),
        exchanged=_messages(exchanged),
    )


def _messages(messages: list[Message]) -> Integers:
    flat = [-1 if value is None else value for message in messages for value in message]
    return np.array(flat, dtype=np.int64).reshape(-1, 4)


def _ends(counts: list[int]) -> Integers:
    return np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)
