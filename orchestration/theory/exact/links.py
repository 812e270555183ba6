"""Tasks and links: which components sample when, and the messages between them. Times are whole attoseconds."""

from dataclasses import dataclass
from fractions import Fraction

from orchestration.foundation.basics.times import NANOSECONDS, exact_nanoseconds
from orchestration.theory.exact.random_times import CERTAIN, RandomTime

ATTOSECONDS = 10**18


@dataclass(frozen=True, kw_only=True)
class SampledTask:
    """A component that samples at each offset + k period + jitter."""

    name: str
    period: Fraction
    offsets: tuple[Fraction, ...] = (Fraction(0),)
    """Offsets in ascending order"""
    jitter: RandomTime = CERTAIN


@dataclass(frozen=True, kw_only=True)
class RandomLink:
    """The messages of one connection: one at each sample of its sender, or of its receiver."""

    name: str
    size: int
    """numbers in a message"""
    sender: int | None = None
    """index of the sending task; None: continuous time"""
    receiver: int | None = None
    """index of the receiving task, likewise"""
    step: Fraction | None = None
    """period of the messages, where no task sends or receives"""
    send_offsets: tuple[Fraction, ...] = (Fraction(0),)
    """Offsets of the messages in each step"""
    transit_times: tuple[int | None, ...] = (0,)
    """Time in transit to which the delay is added, for each offset of its sender, or of `send_offsets`; None: nothing
    is sent"""
    delay: int = 0
    delay_jitter: RandomTime = CERTAIN
    loss: float = 0.0
    burst_length: float | None = None
    jacobi: bool = False
    settles: bool = False
    """whether it goes to a component in continuous time, on which it acts after the samples of the instant"""
    first_order: bool = False
    """whether its hold is of first order"""

    @property
    def longest_delay(self) -> int:
        """The longest time from sending to arrival."""
        transit = max((each for each in self.transit_times if each is not None), default=0)
        return transit + self.delay + self.delay_jitter.highest

    @property
    def is_measured(self) -> bool:
        """Whether a task reads a signal in continuous time."""
        return self.sender is None and self.receiver is not None

    @property
    def is_read_ahead(self) -> bool:
        """Whether it is measured before the sample that uses it."""
        return self.is_measured and self.longest_delay > 0

    @property
    def has_bursts(self) -> bool:
        """Whether a loss makes the next one likelier."""
        return self.burst_length is not None and 0.0 < self.loss < 1.0


def exact_seconds(seconds: float) -> Fraction:
    """The rational number that the decimal form of `seconds` means."""
    return exact_nanoseconds(seconds) / NANOSECONDS


def attoseconds(seconds: Fraction) -> int:
    """A time in whole attoseconds."""
    return round(seconds * ATTOSECONDS)
