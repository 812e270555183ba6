"""The recording of a run for expressions: its rows, signals between them, and arrivals of messages.

A run is read span by span, so that it need not fit into memory; each span begins with the last row of the one before.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, TypeAlias

from orchestration.foundation.basics.errors import UsageError
from orchestration.foundation.basics.simulator import Booleans, Floats

TIME, STOP_TIME = "time", "stop_time"


@dataclass(frozen=True, kw_only=True)
class Recorded:
    """A span of a run: `time` [s], shape (n,), increasing, and a signal of shape (n,) by name."""

    time: Floats
    signals: Mapping[str, Floats]
    ends: Mapping[str, Floats] = field(default_factory=dict)
    """of held signals: the value just before the next row, shape (n - 1,), reached along a line; all others are in
    continuous time, known at the rows and linear between them"""
    numbers: Mapping[str, float] = field(default_factory=dict)
    """constants of the run, such as parameters, by name"""
    arrivals: Mapping[str, Booleans] = field(default_factory=dict)
    """by connection, the rows at which a message arrived, shape (n,)"""
    stop_time: float
    """[s], at which the run ended"""
    goes_on: bool = False
    """whether the first row is the last one of the span before"""

    @cached_property
    def vectors(self) -> dict[str, tuple[str, ...]]:
        """The names of vectors: `plant.position` for its .x, .y, .z (and .w)."""
        return vectors(self.signals)


Spans: TypeAlias = Callable[[], Iterator[Recorded]]
"""The spans of a run, in order; can be iterated repeatedly"""


def unknown(name: str) -> UsageError:
    """The error for a name that an objective cannot have."""
    return UsageError(f"there is no {name}; expected a recorded signal, time, stop_time or an objective above it")


def alone(connection: str) -> UsageError:
    """The error for samples of a connection that are not reduced to a number."""
    return UsageError(f"sampled({connection}, …): expected inside max, mean, rms, share or growth_share")


def vectors(signals: Mapping[str, Any]) -> dict[str, tuple[str, ...]]:
    """The names of vectors among `signals`, with their components."""
    found: dict[str, list[str]] = {}
    for axis in "xyzw":
        for name in signals:
            if name.endswith(f".{axis}"):
                found.setdefault(name[:-2], []).append(name)
    return {name: tuple(parts) for name, parts in found.items() if len(parts) > 1 and name not in signals}
