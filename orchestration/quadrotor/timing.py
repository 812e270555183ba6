"""How the digital loop is clocked: the timing of a run as one frozen value, and time in integer nanoseconds."""

import math
from dataclasses import dataclass, field, fields
from fractions import Fraction
from typing import ClassVar, Literal, get_args

from orchestration.errors import UsageError, shown
from orchestration.system.times import exact_nanoseconds

Order = Literal["gauss-seidel", "jacobi"]
Hold = Literal["zero", "first"]
ClockSource = Literal["master", "fmu"]
Distribution = Literal["uniform", "normal"]


@dataclass(frozen=True, kw_only=True)
class Timing:
    """How the digital loop is clocked; times in seconds.

    Raises `UsageError` for a value that cannot be: negative times, jitter not below the period,
    probabilities outside [0, 1].
    """

    __pydantic_config__: ClassVar[dict[str, str]] = {"extra": "forbid"}

    period: float = 0.01
    """T, of the controller"""
    offset: float = 0.0
    """o, of the first sample"""
    plant_interval: float = 0.001
    """of the plant's own communication points, each of which is recorded"""
    order: Order = "gauss-seidel"
    """whether a command is available at its sample (gauss-seidel) or at the next one (jacobi)"""
    hold: Hold = "zero"
    """of the command between arrivals: constant, or the line through the last two applied"""
    clock: ClockSource = "master"
    """who decides when the controller samples"""
    delay: float = 0.0
    """d, from sample to application; may exceed the period"""
    delay_jitter: float = 0.0
    """J_d, largest random addition to the delay"""
    jitter: float = 0.0
    """J, largest lateness of a sampling instant"""
    jitter_distribution: Distribution = "uniform"
    """of both jitters over [0, J]; normal is centred at J/2 with standard deviation J/6, cut to the range"""
    measurement_loss: float = 0.0
    """probability that a measurement is lost"""
    command_loss: float = 0.0
    """probability that a command is lost"""
    burst_length: float | None = None
    """mean number of losses in a row (Gilbert-Elliott); None: independent losses"""
    clock_ratio: float = 1.0
    """r, seconds that the controller believes pass per true second"""
    noise: dict[str, float] = field(default_factory=dict)
    """standard deviation by measurement name (a vector's name stands for its components)"""
    quantisation: dict[str, float] = field(default_factory=dict)
    """quantum by measurement name"""

    def __post_init__(self) -> None:
        for name, choices in _CHOICES.items():
            _require(getattr(self, name) in choices, name, getattr(self, name), f"one of {', '.join(choices)}")
        for name in _NUMBERS:
            _require(is_number(getattr(self, name)), name, getattr(self, name), "a number")
        for name in ("period", "plant_interval", "clock_ratio"):
            value = getattr(self, name)
            _require(math.isfinite(value) and value > 0.0, name, value, "a positive number")
        for name, ratio in (("period", self.clock_ratio), ("plant_interval", 1.0)):
            value = getattr(self, name)
            _require(exact_nanoseconds(value) >= Fraction(repr(float(ratio))), name, value, "at least a nanosecond")
        for name in ("offset", "delay", "delay_jitter", "jitter"):
            value = getattr(self, name)
            _require(math.isfinite(value) and value >= 0.0, name, value, "zero or a positive number of seconds")
        for name in ("measurement_loss", "command_loss"):
            _require(0.0 <= getattr(self, name) <= 1.0, name, getattr(self, name), "a probability in [0, 1]")
        for name in ("noise", "quantisation"):
            for variable, value in getattr(self, name).items():
                valid = is_number(value) and math.isfinite(value) and value >= 0.0
                _require(valid, f"{name} of {variable}", value, "zero or positive")
        longest = self.period / self.clock_ratio
        _require(self.jitter < longest, "jitter", self.jitter, f"less than the period of {longest:g} s")
        self._check_bursts()
        self._check_fmu_clock()

    def _check_bursts(self) -> None:
        if self.burst_length is None:
            return
        length = self.burst_length
        _require(is_number(length) and 1.0 <= length < math.inf, "burst_length", length, "at least 1 loss")
        for name in ("measurement_loss", "command_loss"):
            loss = getattr(self, name)
            possible = self.burst_length / (self.burst_length + 1.0)
            _require(
                loss <= possible or loss == 1.0, name, loss, f"at most {possible:g} in bursts of {self.burst_length:g}"
            )

    def _check_fmu_clock(self) -> None:
        if self.clock != "fmu":
            return
        _require(self.jitter == 0.0, "jitter", self.jitter, "0 with clock fmu: only the master's clock can be late")
        _require(self.clock_ratio == 1.0, "clock_ratio", self.clock_ratio, "1 with clock fmu")
        whole = all(exact_nanoseconds(t).denominator == 1 for t in (self.period, self.offset))
        _require(
            whole or self.period >= 1e-3, "period", self.period,
            "a whole number of nanoseconds with clock fmu, whose tolerance is 1e-6 of a period",
        )  # fmt: skip

    def warnings(self, stop_time: float) -> tuple[str, ...]:
        """What a run of this length [s] hardly shows of this timing."""
        end = f"the run ends at {shown(stop_time)} s"
        if self.offset / self.clock_ratio >= stop_time:
            return (f"timing.offset = {shown(self.offset)}: {end}, so the controller never samples",)
        if (self.offset + self.period) / self.clock_ratio >= stop_time:
            return (f"timing.period = {shown(self.period)}: {end}, so the controller samples only once",)
        if self.delay >= stop_time:
            return (f"timing.delay = {shown(self.delay)}: {end}, so no command arrives",)
        return ()

    def is_deterministic(self) -> bool:
        """Whether no random number is drawn."""
        return not (
            self.jitter or self.delay_jitter or self.measurement_loss or self.command_loss or any(self.noise.values())
        )


_CHOICES: dict[str, tuple[str, ...]] = {
    "order": get_args(Order),
    "hold": get_args(Hold),
    "clock": get_args(ClockSource),
    "jitter_distribution": get_args(Distribution),
}
_NUMBERS = (
    "period", "offset", "plant_interval", "delay", "delay_jitter", "jitter", "measurement_loss", "command_loss",
    "clock_ratio",
)  # fmt: skip


def is_number(value: object) -> bool:
    """Whether `value` can be a time, a share or a factor; true and false are none, nor is what no float holds."""
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        return False
    return isinstance(value, float) or abs(value) < 2**63


def _require(condition: bool, name: str, value: object, expected: str) -> None:
    if not condition:
        raise UsageError(f"timing.{name} = {shown(value)}: expected {expected}")


TIMING_KEYS = tuple(f.name for f in fields(Timing))
