"""Sliders of pages by kind of request, which rooms above register."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from orchestration.foundation.basics.registry import Registry

if TYPE_CHECKING:
    from orchestration.experiments.live.sliders import Sliders
    from orchestration.systems.system.request import Request

KNOWN_SLIDERS: Registry[Callable[[Request], Sliders]] = Registry()
"""Rooms above register theirs"""
