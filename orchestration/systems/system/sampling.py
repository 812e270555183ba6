"""When a digital task runs: at every period of its own clock, as a task of a computer, or when a message arrives."""

from orchestration.foundation.basics.records import record
from orchestration.foundation.basics.times import is_at_least
from orchestration.systems.system.choices import Clock, Spread
from orchestration.systems.system.distribution import (
    Varying,
    highest,
    reads_file,
    require_spread,
    require_varying,
    spreads,
)
from orchestration.systems.system.requirements import require, require_not_negative, require_own_clock, require_positive


@record()
class Sampling:
    """When a digital task runs; times in seconds of the true clock, but for `period` and `offset` (its own)."""

    period: float
    """The period T of the task [s], in its own time: instant k is offset + kT."""
    offset: float = 0.0
    """The time of the first instant [s], in its own time."""
    jitter: Varying = 0.0
    """The largest lateness J of an instant [s], drawn for each, or the distribution of the lateness itself; it is less
    than the period."""
    jitter_distribution: Spread = "uniform"
    """The distribution over [0, J] of a lateness whose largest value is given; normal is centred at J/2 with standard
    deviation J/6, cut to the range."""
    clock_ratio: float = 1.0
    """The seconds r that the component believes pass per true second."""
    clock: Clock = "master"
    """What decides when it samples: the master, or the FMU by its parameters sample_period and sample_offset."""

    def __post_init__(self) -> None:
        require_positive(self, "period", "clock_ratio")
        require_not_negative(self, "offset")
        require_varying(self, "jitter")
        require_spread(self.jitter_distribution, self.jitter)
        require(is_at_least(self.period, self.clock_ratio), "period", self.period, "at least a nanosecond")
        if not reads_file(self.jitter):
            self.expect_jitter_within_period()
        if self.clock == "fmu":
            require_own_clock(self)

    @property
    def is_random(self) -> bool:
        """Whether the seed changes its instants."""
        return spreads(self.jitter)

    def expect_jitter_within_period(self) -> None:
        """Raise `UsageError` for a lateness of a period or more; that of a trace is known when the file is read."""
        longest, most = self.period / self.clock_ratio, highest(self.jitter)
        require(most < longest, "jitter", most, f"less than the period of {longest:g} s")


@record()
class TaskSampling(Sampling):
    """The approximate instants of a task of a computer: its period, or that of what releases it.

    A system makes it from the task; the scheduler computes when the task runs.
    """

    task: str
    """The path of the task."""


@record()
class SamplingOnArrival(Sampling):
    """When a digital task runs that messages release: whenever one arrives."""

    on: str
    """The connection whose arriving messages it runs on, in place of a period."""
    period: float = 0.0
    """Approximate; the system sets it."""

    def __post_init__(self) -> None:
        require_positive(self, "clock_ratio")
        for key in ("offset", "jitter"):
            require(getattr(self, key) == 0.0, key, getattr(self, key), "0 beside on: messages say when it runs")
        require(self.clock == "master", "clock", self.clock, "master beside on: messages say when it runs")


def has_scheduled_instants(sampling: Sampling) -> bool:
    """Whether the scheduler computes its instants."""
    return isinstance(sampling, (TaskSampling, SamplingOnArrival))
