"""Roles that FMUs of this project can have in a loop, and the variables that each needs for it."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple


class Port(NamedTuple):
    """A variable as it has to be declared."""

    name: str
    causality: str
    unit: str | None
    kind: str = "Real"


@dataclass(frozen=True, kw_only=True)
class Role:
    """What can be wired to an FMU."""

    told_by: Sequence[str]
    """outputs of which any says that it has this role, unless it has one before"""
    ports: Sequence[Port]
    further: Sequence[Port] = ()
    """what may be missing, unless it has any of `whole_by`; what there is of it is as it is here"""
    whole_by: Sequence[str] = ()


ROLES: list[Role] = []
"""Rooms above enter theirs"""
