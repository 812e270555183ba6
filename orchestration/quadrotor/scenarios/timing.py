"""The timing of the digital loop of a run as one frozen value, and those of real flight stacks by name."""

import math
from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any, ClassVar

from orchestration.foundation.basics.bisection import Range
from orchestration.foundation.basics.documents import read_toml
from orchestration.foundation.basics.errors import UsageError, expected_name, shown
from orchestration.foundation.basics.records import record
from orchestration.foundation.basics.times import is_at_least
from orchestration.systems.system import distribution
from orchestration.systems.system.choices import Clock, Hold, Order, Spread
from orchestration.systems.system.distribution import highest
from orchestration.systems.system.requirements import (
    is_finite,
    require,
    require_not_negative,
    require_own_clock,
    require_positive,
)

_PLACE = "timing."
LOSSES = ("measurement_loss", "command_loss")
"""Keys that `loss` stands for"""


@record("timing.")
class Timing:
    """The timing of the digital loop; times in seconds.

    Raises `UsageError` for invalid values: negative times, jitter not below the period, probabilities outside [0, 1].
    """

    SHORTHANDS: ClassVar[tuple[str, ...]] = ("loss", "preset")
    """Keys of `[timing]` in a file that expand to others"""

    period: float = 0.01
    """The sampling period T of the controller [s], by its own clock: sample k is at offset + kT."""
    offset: float = 0.0
    """The time of the first sample [s]."""
    plant_interval: float = 0.001
    """The distance of the plant's own communication points [s], each of which is recorded."""
    order: Order = "gauss-seidel"
    """Whether a command can be applied at the instant of its sample (gauss-seidel) or at the next one (jacobi)."""
    hold: Hold = "zero"
    """The command of the plant between arrivals: the last one (zero), or the line through the last two (first)."""
    clock: Clock = "master"
    """The clock by which the controller samples: that of the master, or of the FMU, by its parameters sample_period and
    sample_offset."""
    delay: distribution.Varying = 0.0
    """The time d from a sample to the application of its command [s], or its distribution; it may exceed the period."""
    delay_jitter: distribution.Varying = 0.0
    """The largest random addition J_d to the delay of each command [s], or the distribution of the addition
    itself."""
    jitter: distribution.Varying = 0.0
    """The largest lateness J of a sample [s], drawn for each, or the distribution of the lateness itself; it is less
    than the period."""
    jitter_distribution: Spread = "uniform"
    """The distribution over [0, J], and over [0, J_d], of what is given by its largest value; normal is centred at J/2
    with standard deviation J/6, cut to the range."""
    measurement_loss: distribution.Varying = 0.0
    """The probability that a measurement is lost, or values of 0 and 1, as of a trace: 1 for a lost one."""
    command_loss: distribution.Varying = 0.0
    """The probability that a command is lost, or likewise."""
    burst_length: float | None = None
    """The mean number of losses in a row (Gilbert-Elliott); default: losses are independent."""
    clock_ratio: float = 1.0
    """The seconds r that the controller believes pass per true second."""
    noise: dict[str, float] = field(default_factory=dict)
    """The standard deviation of normal noise by measurement, in its unit; a vector's name stands for its components."""
    quantisation: dict[str, float] = field(default_factory=dict)
    """The step to which a measurement is rounded, in its unit, by measurement, likewise."""

    def __post_init__(self) -> None:
        require_positive(self, "period", "plant_interval", "clock_ratio", place=_PLACE)
        for name, ratio in (("period", self.clock_ratio), ("plant_interval", 1.0)):
            value = getattr(self, name)
            require(is_at_least(value, ratio), _PLACE + name, value, "at least a nanosecond")
        require_not_negative(self, "offset", place=_PLACE)
        distribution.require_varying(self, "delay", "delay_jitter", "jitter", place=_PLACE)
        distribution.require_spread(self.jitter_distribution, self.jitter, self.delay_jitter, place=_PLACE)
        distribution.require_losses(self, self.burst_length, *LOSSES, place=_PLACE)
        for what in ("noise", "quantisation"):
            for variable, value in getattr(self, what).items():
                require(is_finite(value) and value >= 0.0, f"{_PLACE}{what} of {variable}", value, "zero or positive")
        longest = self.period / self.clock_ratio
        if not distribution.reads_file(self.jitter):
            most = distribution.highest(self.jitter)
            require(most < longest, f"{_PLACE}jitter", most, f"less than the period of {shown(longest)} s")
        if self.clock == "fmu":
            require_own_clock(self, _PLACE)


TIMING_KEYS = tuple(f.name for f in fields(Timing))


@dataclass(frozen=True, kw_only=True)
class Preset:
    """A stack: the rates of its cascade [Hz], and the timing keys [s] of a single-rate controller on it."""

    loops_hz: Mapping[str, float]
    timing: Mapping[str, float]


_FILE = Path(__file__).with_name("presets.toml")
PRESETS = {name: Preset(**rates) for name, rates in read_toml(_FILE, "file of presets").items()}


def preset_timing(name: str) -> dict[str, Any]:
    """The timing keys of a preset; raises `UsageError` that lists the presets for an unknown name."""
    if name not in PRESETS:
        raise UsageError(f"preset {name}: {expected_name(name, list(PRESETS))}")
    return dict(PRESETS[name].timing)


@contextmanager
def loss_as_written(written: Collection[str]) -> Iterator[None]:
    """Of timing keys as `written`, `loss` in errors in place of the losses that it stands for."""
    try:
        yield
    except UsageError as error:
        for key in LOSSES if "loss" in written else ():
            if key not in written:
                error.args = (error.args[0].replace(_PLACE + key, f"{_PLACE}loss"),)
        raise


def range_of(timing: Timing, of: str) -> Range | None:
    """The search range of `period`, `delay`, `jitter` or `loss` with the rest of `timing` fixed; None: other names."""
    if of == "period":
        shortest = highest(timing.jitter) * timing.clock_ratio
        before = tuple(value for value in (0.001, 0.002, 0.003, 0.004) if value > shortest)
        first = 0.005 * (math.floor(shortest / 0.005) + 1)
        return Range(before=before, first=first, step=0.005, last=0.5, tolerance=0.0005)
    if of == "delay":
        return Range(first=0.0, step=0.005, last=0.5, tolerance=0.0005)
    if of == "jitter":
        return Range(first=0.0, step=timing.period / 10.0, last=0.999 * timing.period, tolerance=timing.period / 100.0)
    if of == "loss":
        length = timing.burst_length
        last = 1.0 if length is None else length / (length + 1.0)
        return Range(first=0.0, step=0.05, last=last, tolerance=0.01, unit=None)
    return None
