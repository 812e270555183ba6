"""Roles of FMUs of this project in a loop, with the variables that each needs."""

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
    """The variables of an FMU that can be connected."""

    identified_by: Sequence[str]
    """outputs any of which identifies this role; the first such role counts"""
    ports: Sequence[Port]
    optional: Sequence[Port] = ()
    """may be missing, unless the FMU has any of `complete_by`; those present must be as declared here"""
    complete_by: Sequence[str] = ()


ROLES: list[Role] = []
"""filled by the rooms above"""
