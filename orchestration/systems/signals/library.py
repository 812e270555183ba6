"""Signals by name with their parameters, and the limits of a curve through way-points."""

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from orchestration.foundation.basics.errors import UsageError, expected_name, prefixed, shown
from orchestration.systems.signals.dryden import Dryden
from orchestration.systems.signals.motions import MOTIONS

AXES = ("x", "y", "z")
"""Columns of way-points [m], inertial"""


@dataclass(frozen=True, kw_only=True)
class SignalLimits:
    """The limits of a curve through way-points without times."""

    speed: float = 1.0
    """Speed for points without one in the file [m/s]"""
    acceleration: float = 1.0
    """Largest acceleration [m/s²]"""

    def __post_init__(self) -> None:
        for name in ("speed", "acceleration"):
            value = getattr(self, name)
            if not value > 0.0:
                raise UsageError(f"{name} = {value}: expected a positive number")


KINDS: dict[str, dict[str, type]] = {"motion": {**MOTIONS}, "wind": {"dryden": Dryden}}
SIGNALS = {name: kind for kinds in KINDS.values() for name, kind in kinds.items()}
WAY_POINTS = "way-points"


def make_signal(name: str, parameters: Mapping[str, Any], among: Mapping[str, type] = SIGNALS) -> Any:
    """The signal of a name with these parameters, and its defaults for the others.

    Raises `UsageError` for an unknown name or parameter, naming the known ones, or an invalid value.
    """
    if name not in among:
        raise UsageError(f"signal = {shown(name)}: {expected_name(str(name), list(among))}")
    return _with_parameters(name, among[name], parameters)


def limits(parameters: Mapping[str, Any]) -> SignalLimits:
    """The limits of a curve through way-points; raises `UsageError` as `make_signal` does."""
    found: SignalLimits = _with_parameters(WAY_POINTS, SignalLimits, parameters)
    return found


def _with_parameters(name: str, kind: type, parameters: Mapping[str, Any]) -> Any:
    known = [field.name for field in dataclasses.fields(kind)]
    for key, value in parameters.items():
        if key not in known:
            raise UsageError(f"parameters.{key}: {name} has no such parameter; {expected_name(key, known)}")
        if isinstance(value, bool) or not isinstance(value, (int, float)) or not math.isfinite(value):
            raise UsageError(f"parameters.{key} = {shown(value)}: expected a finite number")
    with prefixed("parameters."):
        return kind(**{key: float(value) for key, value in parameters.items()})
