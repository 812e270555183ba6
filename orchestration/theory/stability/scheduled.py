"""Systems with a scheduler, of computers, networks or sampling on arrival; and the randomness of their schedule."""

from collections.abc import Iterator
from dataclasses import replace

from orchestration.foundation.basics.errors import UsageError
from orchestration.systems.system.component import Sampling, has_scheduled_instants
from orchestration.systems.system.distribution import Distribution, Varying
from orchestration.systems.system.model import System
from orchestration.systems.system.placement import messages_by_connection, placed_messages, placed_tasks, released_by


def without_scheduler(system: System) -> System:
    """The same components and connections, each component sampled periodically, without computers and networks."""
    if not system.uses_scheduler:
        return system
    components = {
        name: one
        if one.sampling is None or not has_scheduled_instants(one.sampling)
        else replace(one, sampling=Sampling(period=one.sampling.period, clock_ratio=one.sampling.clock_ratio))
        for name, one in system.components.items()
    }
    prefixes = ("computers.", "networks.")
    return replace(
        system, components=components, computers={}, networks={},
        streams={name: number for name, number in system.streams.items() if not name.startswith(prefixes)},
        operating_point={path: x for path, x in system.operating_point.items() if not path.startswith(prefixes)},
    )  # fmt: skip


def expect_certain(system: System) -> None:
    """Raise `UsageError` for a random quantity that the scheduler depends on."""
    for place, what in _random_quantities(system):
        raise UsageError(
            f"{place}: {what}, and the lateness of the others depends on its history; expected one value (the "
            "mean, or the largest), or an average over runs (quadcosim sweep)"
        )


def _random_quantities(system: System) -> Iterator[tuple[str, str]]:
    """Their places in the system file, and in what way they are random."""
    drawn = "random from job to job"
    for task in placed_tasks(system.computers):
        if task.task.arrivals is not None:
            yield f"{task.place}.arrivals", "random"
        if _varies(task.task.execution):
            yield f"{task.place}.execution", drawn
        if _varies(task.task.jitter, is_largest=True):
            yield f"{task.place}.jitter", drawn
    for message in placed_messages(system.networks):
        if message.message.arrivals is not None:
            yield f"{message.place}.arrivals", "random"
        if _varies(message.message.jitter, is_largest=True):
            yield f"{message.place}.jitter", "random from message to message"
        if message.network.error > 0.0:
            yield f"networks.{message.network_name}.error", "frames are repeated at random"
    over, releases = messages_by_connection(system), released_by(system)
    for x in system.connections:
        sampling = system.components[x.sender].sampling
        if (x.name in over or x.name in releases) and sampling is not None and sampling.is_random:
            yield f"components.{x.sender}.sampling.jitter", drawn
        if x.name not in releases:
            continue
        if _varies(x.delay):
            yield f"connections.{x.name}.delay", "random, of messages that release a task"
        if _varies(x.delay_jitter, is_largest=True):
            yield f"connections.{x.name}.delay_jitter", "random, of messages that release a task"
        if _varies(x.loss) or (not isinstance(x.loss, Distribution) and 0.0 < x.loss < 1.0):
            yield f"connections.{x.name}.loss", "random, of messages that release a task"


def _varies(of: Varying, *, is_largest: bool = False) -> bool:
    if isinstance(of, Distribution):
        return of.lowest < of.highest
    return is_largest and of > 0.0
