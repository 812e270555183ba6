"""The table of the classes that processes may send to the one that started them, besides plain data."""

from typing import TypeVar

Class = TypeVar("Class", bound=type)

PASSABLE: dict[str, type] = {}
"""Dataclasses, exceptions and floats of a class of their own by their full names"""


def passable(cls: Class) -> Class:
    """Decorate a dataclass, an exception or a class of floats whose objects may be sent."""
    PASSABLE[full_name(cls)] = cls
    return cls


def full_name(cls: type) -> str:
    """Module and name of a class."""
    return f"{cls.__module__}.{cls.__qualname__}"


for _error in (KeyboardInterrupt, MemoryError):
    passable(_error)
