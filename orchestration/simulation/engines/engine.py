"""Choice of the engine of a run: the compiled loop where available, else Python. Both give the same bytes."""

import logging
from collections.abc import Mapping
from functools import partial
from typing import Any, Literal, cast, get_args

from orchestration.foundation.basics.errors import QuadcosimError, UsageError, expected_name
from orchestration.foundation.basics.simulator import Simulator
from orchestration.foundation.basics.times import nanoseconds
from orchestration.simulation.engines.compiled import CompiledLoop, reason_unavailable
from orchestration.simulation.engines.master import Master
from orchestration.simulation.engines.memory import Allocator
from orchestration.systems.system.model import System

_NOTES = logging.getLogger("quadcosim")

Engine = Literal["python", "compiled"]


def engine_named(name: str | None, *others: str) -> Engine | None:
    """The engine of that name; raises `UsageError` for an unknown name, listing `others` too."""
    if name is not None and name not in get_args(Engine):
        raise UsageError(f"--engine {name}: {expected_name(name, [*get_args(Engine), *others])}")
    return cast(Engine | None, name)


def create_master(
    engine: Engine | None,
    system: System,
    simulators: Mapping[str, Simulator],
    *,
    allocate: Allocator,
    **others: Any,
) -> Master:
    """The master of a run, with an engine; default: the compiled loop where available.

    The compiled loop keeps what it has not handed over in memory of `allocate`; `others` are arguments of `Master`.
    Raises `QuadcosimError` with the reason if the compiled loop was requested and is not available.
    """
    reason = None if engine == "python" else reason_unavailable(simulators, nanoseconds(system.stop_time))
    if reason:
        _NOTES.debug("no compiled loop: %s", reason)
    if engine == "python" or (engine is None and reason):
        return Master(system, simulators, **others)
    if reason:
        raise QuadcosimError(f"--engine compiled is not available: {reason}")
    return Master(system, simulators, loop=partial(CompiledLoop, allocate=allocate), **others)
