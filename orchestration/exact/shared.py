"""Systems in which a scheduler decides when something happens, and what of that is left to chance."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from orchestration.basics.errors import UsageError
from orchestration.system.distribution import Distribution, Varying
from orchestration.system.model import System
from orchestration.system.placement import carried, placed_messages, placed_tasks, released_by
from orchestration.system.sampling import Sampling, is_foreseen


def is_shared(system: System) -> bool:
    """Whether a scheduler decides when something of a system happens."""
    samplings = (one.sampling for one in system.components.values())
    on_arrivals = any(each is not None and is_foreseen(each) for each in samplings)
    return bool(system.computers or system.networks) or on_arrivals


def by_itself(system: System) -> System:
    """The same components and connections, each component sampled by itself, and no message late."""
    if not is_shared(system):
        return system
    components = {
        name: one
        if one.sampling is None or not is_foreseen(one.sampling)
        else replace(one, sampling=Sampling(period=one.sampling.period, clock_ratio=one.sampling.clock_ratio))
        for name, one in system.components.items()
    }
    there = ("computers.", "networks.")
    return replace(
        system, components=components, computers={}, networks={},
        streams={name: number for name, number in system.streams.items() if not name.startswith(there)},
        operating_point={path: value for path, value in system.operating_point.items() if not path.startswith(there)},
    )  # fmt: skip


def expect_certain(system: System) -> None:
    """Raise `UsageError` for what is random in what the scheduler decides."""
    for place, what in _left_to_chance(system):
        raise UsageError(
            f"{place}: {what}, and how late the others are depends on all before; expected one value (the mean, or the "
            "largest), or an average over runs (quadcosim sweep)"
        )


def _left_to_chance(system: System) -> Iterator[tuple[str, str]]:
    """Places of what is not the same each time, and how it comes about."""
    drawn = "not the same for each job"
    for task in placed_tasks(system.computers):
        if task.task.arrivals is not None:
            yield f"{task.place}.arrivals", "they come by chance"
        if _varies(task.task.execution):
            yield f"{task.place}.execution", drawn
        if _varies(task.task.jitter, is_largest=True):
            yield f"{task.place}.jitter", drawn
    for message in placed_messages(system.networks):
        if message.message.arrivals is not None:
            yield f"{message.place}.arrivals", "they come by chance"
        if _varies(message.message.jitter, is_largest=True):
            yield f"{message.place}.jitter", "not the same for each message"
        if message.network.error > 0.0:
            yield f"networks.{message.network_name}.error", "frames are sent again by chance"
    over, releases = carried(system), released_by(system)
    for x in system.connections:
        sampling = system.components[x.sender].sampling
        if (x.name in over or x.name in releases) and sampling is not None and sampling.is_random:
            yield f"components.{x.sender}.sampling.jitter", drawn
        if x.name not in releases:
            continue
        if _varies(x.delay):
            yield f"connections.{x.name}.delay", "not the same for each message that releases a task"
        if _varies(x.delay_jitter, is_largest=True):
            yield f"connections.{x.name}.delay_jitter", "not the same for each message that releases a task"
        if _varies(x.loss) or (not isinstance(x.loss, Distribution) and 0.0 < x.loss < 1.0):
            yield f"connections.{x.name}.loss", "not the same for each message that releases a task"


def _varies(of: Varying, *, is_largest: bool = False) -> bool:
    if isinstance(of, Distribution):
        return of.lowest < of.highest
    return is_largest and of > 0.0
