"""Requirements on values of systems and timings; each raises `UsageError`, in one line, if it is not met."""

import math
from typing import Any, TypeGuard

from orchestration.foundation.basics.errors import UsageError, shown, told_apart, without_unit
from orchestration.foundation.basics.times import exact_nanoseconds


def is_number(value: object) -> TypeGuard[float]:
    """Whether `value` can be a time, a share or a factor: no truth value, and within the range of a float."""
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        return False
    return isinstance(value, float) or abs(value) < 2**63


def is_finite(value: object) -> TypeGuard[float]:
    """Whether it is a number and neither infinite nor NaN."""
    return is_number(value) and math.isfinite(value)


def require(condition: bool, name: str, value: object, expected: str) -> None:
    """Require the condition; the error reports `name`, `value` and what is `expected`."""
    if not condition:
        raise UsageError(f"{name} = {shown(value)}: expected {without_unit(expected, value)}")


def _quoted(value: object) -> object:
    """The value; text, which may look like a number, in quotes."""
    return repr(value) if isinstance(value, str) else value


def require_positive(of: object, *names: str, place: str = "") -> None:
    """Require the fields `names` to be finite and above 0."""
    for name in names:
        value = getattr(of, name)
        require(is_finite(value) and value > 0.0, place + name, _quoted(value), "a positive number")


def require_not_negative(of: object, *names: str, place: str = "") -> None:
    """Require the fields `names` to be finite and not below 0."""
    for name in names:
        value = getattr(of, name)
        require(is_finite(value) and value >= 0.0, place + name, _quoted(value), "zero or a positive number")


def require_loss(of: object, name: str, burst_length: float | None, place: str) -> None:
    """Require the field `name` to be a probability that allows bursts of this mean length; None: independent losses."""
    loss, length = getattr(of, name), burst_length
    require(is_number(loss) and 0.0 <= loss <= 1.0, place + name, loss, "a probability in [0, 1]")
    if length is None:
        return
    require(is_number(length) and 1.0 <= length < math.inf, f"{place}burst_length", length, "at least 1 loss")
    possible = length / (length + 1.0)
    at_most = f"at most {told_apart(loss, possible)[1]} in bursts of {length:g}"
    require(loss <= possible or loss == 1.0, place + name, loss, at_most)


def require_own_clock(of: Any, place: str = "") -> None:
    """Require `period`, `offset`, `jitter` and `clock_ratio` to be possible for an FMU with its own clock."""
    late = "0 with clock fmu: only the master's clock can be late"
    require(of.jitter == 0.0, f"{place}jitter", of.jitter, late)
    require(of.clock_ratio == 1.0, f"{place}clock_ratio", of.clock_ratio, "1 with clock fmu")
    whole = all(exact_nanoseconds(t).denominator == 1 for t in (of.period, of.offset))
    counts = "a whole number of nanoseconds with clock fmu, whose tolerance is 1e-6 of a period"
    require(whole or of.period >= 1e-3, f"{place}period", of.period, counts)
