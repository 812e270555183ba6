"""The input clock of FMI 3.0 at whose ticks a slave samples that otherwise has its own period."""

from __future__ import annotations

from typing import Any

CLOCK = "sample_clock"
"""Name of the clock"""
_PERIOD = "sample_period"


def sampling_period(slave: Any) -> int | None:
    """The value reference of the parameter that is the period of its samples, 0 for one at every step; None: none."""
    return next((i for i, v in enumerate(slave.variables) if v.name == _PERIOD and v.is_settable), None)


def samples(slave: Any) -> bool:
    """Whether it has one."""
    return sampling_period(slave) is not None
