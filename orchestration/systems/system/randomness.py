"""Whether the runs of a system depend on their seed."""

from orchestration.systems.system import placement
from orchestration.systems.system.model import System


def depends_on_seed(system: System) -> bool:
    """Whether the seed changes its runs."""
    return (
        has_random_timing(system)
        or any(any(x.noise.values()) for x in system.connections)
        or any(source.is_random and source.noise != 0.0 for source in system.sources.values())
    )


def has_random_timing(system: System) -> bool:
    """Whether the seed changes when its components are stepped, or which messages arrive and when."""
    return (
        any(one.sampling is not None and one.sampling.is_random for one in system.components.values())
        or any(x.is_random for x in system.connections)
        or placement.has_random_schedule(system)
    )
