"""The table of kinds of requests beside systems, which higher districts register."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from orchestration.foundation.basics.registry import Registry

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping
    from pathlib import Path

    from orchestration.systems.system.request import Request


@dataclass(frozen=True, kw_only=True)
class RequestKind:
    """A kind of request beside systems."""

    default: Callable[[], Request]
    """Request that runs if nothing is said"""
    from_tables: Callable[[dict[str, Any], Path], Request]
    """Reads a TOML document whose paths are relative to a folder; raises `UsageError`"""
    resting_inputs: Callable[[Mapping[str, Any]], Mapping[str, Any]]
    """Values of inputs of an actuator that has no command yet, from all numeric parameters, both by COMPONENT.NAME;
    of others their start values"""
    files: tuple[Path, ...]
    """The files that it is based on, beside the code"""


KINDS: Registry[RequestKind] = Registry()
"""Kinds of requests: at present one, the scenarios of the quadrotor"""
