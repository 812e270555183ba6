"""What is found wrong with an FMU, and rules as functions that find it."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import TypeVar

Subject = TypeVar("Subject")
Rule = Callable[[Subject], Iterable[str]]
"""Texts of what it finds wrong with a subject; the rule goes by the name of the function."""


class Note(str):
    """The text of a finding that breaks no rule of the standard, but that one should know."""

    __slots__ = ()


@dataclass(frozen=True, slots=True)
class Finding:
    """One thing that is wrong with an FMU, or worth a note."""

    rule: str
    """The rule that is broken, as `start-values`"""
    text: str
    """The variable or file, what was found and what was expected"""
    note: bool = False
    """Whether it is no problem: what the standard allows, or what could not be looked at"""

    def __str__(self) -> str:
        return f"{'note: ' if self.note else ''}{self.rule}: {self.text}"


def name_of(rule: Callable[..., object]) -> str:
    """The name under which a rule reports."""
    return str(getattr(rule, "__name__", rule)).replace("_", "-")


def check(rules: Iterable[Rule[Subject]], subject: Subject) -> list[Finding]:
    """Everything that the rules find."""
    return [Finding(name_of(rule), str(text), note=isinstance(text, Note)) for rule in rules for text in rule(subject)]
