"""Runs whose averages mean nothing: those of loops in which means of squares have no finite expectation."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from orchestration.basics.errors import QuadcosimError, UsageError
from orchestration.building.inputs import Files
from orchestration.exact.loops import Loops
from orchestration.exact.objectives import means_of, whole
from orchestration.fmi.foreign import computed
from orchestration.fmi.model import Model
from orchestration.stability.known_loops import LOOPS
from orchestration.system.chance import is_random
from orchestration.system.model import System
from orchestration.system.request import Request

AGREE = 1e-3
"""of a radius, from order to order: who only wants to know whether it is above 1 need not wait"""
MOST = 50
"""systems that are looked at"""


def endless(request: Request, systems: Sequence[System], files: Files) -> str | None:
    """What a user should know of the averages of such runs, in a line; None: nothing, or nothing that is known.

    Of systems with something random and an objective that is a mean of squares; not of those of which more is known
    than of any other, as they are not linear about where they fly.
    """
    if LOOPS.of(request.kind) is not None:
        return None
    chosen: dict[str, System] = {}
    for system in systems:
        if len(chosen) < MOST and is_random(system) and _averages(system):
            once = replace(system, seed=0)
            chosen.setdefault(once.to_toml(), once)
    if not chosen:
        return None
    try:
        radii = computed(files.fmus.values(), radii_of, [*chosen.values()], files.models)
    except QuadcosimError:
        return None
    above = [radius for radius in radii if radius is not None and radius >= 1.0]
    if not above:
        return None
    where = "" if len(radii) == 1 else f" at {len(above)} of {len(radii)} points"
    averages = ", ".join(_averages(systems[0]))
    return (
        f"{averages}: without a finite expectation{where}, so an average over runs means nothing; "
        f"the mean-square radius is {max(above):.6g} (quadcosim expect)"
    )


def _averages(system: System) -> list[str]:
    """The objectives that are made of means."""
    found = []
    for name, node in whole(system.objectives).items():
        try:
            means_of(node)
        except UsageError:
            continue
        found.append(name)
    return found


def radii_of(systems: Sequence[System], models: Mapping[str, Model]) -> list[float | None]:
    """The mean-square radii of systems; None for one that is not linear about a rest, or too much."""
    loops, found = Loops(models), list[float | None]()
    for system in systems:
        try:
            found.append(loops.radius(system, agree=AGREE))
        except QuadcosimError:
            found.append(None)
    return found
