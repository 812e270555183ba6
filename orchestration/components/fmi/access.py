"""How an FMU is called: by which of its interfaces, and who solves its equations."""

import json
from dataclasses import asdict, dataclass
from typing import Any, Literal, get_args

from orchestration.foundation.processes.passable import passable

Interface = Literal["co-simulation", "event-mode", "model-exchange", "scheduled-execution"]
"""Interfaces of FMUs; event-mode is co-simulation whose events the importer processes"""
SCHEDULED: Interface = "scheduled-execution"
Solver = Literal["dormand-prince", "cvode"]
INTERFACES: tuple[Interface, ...] = get_args(Interface)
SOLVERS: tuple[Solver, ...] = get_args(Solver)


@passable
@dataclass(frozen=True, kw_only=True)
class Access:
    """What a component says of how its FMU is called."""

    interface: Interface | None = None
    """None: co-simulation where it is offered, else model exchange"""
    solver: Solver | None = None
    """None: Dormand and Prince's, for model exchange"""
    clock: str | None = None
    """The periodic input clock that ticks at every sample, for event mode; None: the fastest, if there is any. For
    scheduled execution, that of the partition"""
    start_time: float = 0.0
    """Its own time [s] at 0 of a run"""

    def __str__(self) -> str:
        return json.dumps(asdict(self))

    @classmethod
    def of(cls, text: str) -> "Access":
        """The access that is written as `text`."""
        known: dict[str, Any] = json.loads(text)
        return cls(**known)


USUAL = Access()
"""Access of a component that says nothing"""
