"""What is found wrong with an FMU, and rules as functions that find it."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import TypeVar

Subject = TypeVar("Subject")
Rule = Callable[[Subject], Iterable[str]]
"""Texts of what it finds wrong with a subject; the rule goes by the name of the function."""


@dataclass(frozen=True, slots=True)
class Finding:
    """One thing that is wrong with an FMU."""

    rule: str
    """The rule that is broken, as `start-values`"""
    text: str
    """The variable or file, what was found and what was expected"""

    def __str__(self) -> str:
        return f"{self.rule}: {self.text}"


def name_of(rule: Callable[..., object]) -> str:
    """The name under which a rule reports."""
    return str(getattr(rule, "__name__", rule)).replace("_", "-")


def check(rules: Iterable[Rule[Subject]], subject: Subject) -> list[Finding]:
    """Everything that the rules find."""
    return [Finding(name_of(rule), text) for rule in rules for text in rule(subject)]
