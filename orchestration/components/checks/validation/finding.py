"""Findings about an FMU, and rules as functions that yield them."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import TypeVar

Subject = TypeVar("Subject")
Rule = Callable[[Subject], Iterable[str]]
"""Yields texts of problems of a subject; the rule has the name of the function"""


class Note(str):
    """The text of a finding that violates no rule of the standard, but is worth knowing."""

    __slots__ = ()


@dataclass(frozen=True, slots=True)
class Finding:
    """A problem of an FMU, or a note."""

    rule: str
    """the violated rule, as `start-values`"""
    text: str
    """the variable or file, what was found and what was expected"""
    note: bool = False
    """whether it is no problem: the standard allows it, or it could not be checked"""

    def __str__(self) -> str:
        return f"{'note: ' if self.note else ''}{self.rule}: {self.text}"


def name_of(rule: Callable[..., object]) -> str:
    """The name under which a rule reports."""
    return str(getattr(rule, "__name__", rule)).replace("_", "-")
