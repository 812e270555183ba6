"""What the confined process tells the one that waits for it: findings as they come, and that calls return."""

import time
from collections.abc import Callable, Iterable
from itertools import islice
from typing import Any

from orchestration.basics.errors import QuadcosimError
from orchestration.checks.validation.finding import Finding, Note, Rule, Subject, name_of

MOST = 100
"""Findings of one rule that are listed"""
LONGEST = 1000
"""Characters of the text of a finding"""
_BEAT = 0.02
"""[s] between two beats, at least"""
Frame = tuple[Any, ...]
"""The name of a method of `Told`, and its arguments"""


class Report:
    """Says what begins, what is found and that it ends, as it happens: of use however far the process gets."""

    def __init__(self, say: Callable[[Frame], None]) -> None:
        self._say = say
        self._next = 0.0

    def rule(self, name: str) -> None:
        """A rule begins."""
        self._say(("begin", name))

    def beat(self) -> None:
        """A call of the FMU begins or has returned."""
        now = time.monotonic()
        if now >= self._next:
            self._next = now + _BEAT
            self._say(("beat",))

    def found(self, text: str) -> None:
        """The rule finds something."""
        whole = text if len(text) <= LONGEST else f"{text[:LONGEST]} ..."
        self._say(("found", whole, isinstance(text, Note)))

    def failed(self, error: Exception) -> None:
        """The validation itself fails."""
        self._say(("failed", f"{type(error).__name__}: {error}"))

    def end(self) -> None:
        """All there is to try has been tried."""
        self._say(("end",))

    def tried(self, chosen: Iterable[Rule[Subject]], subject: Subject, refusal: type[QuadcosimError]) -> int:
        """How many problems the rules find; a `refusal` that one runs into is one, too."""
        count = 0
        for rule in chosen:
            self.rule(name_of(rule))
            count += self._of(rule, subject, refusal)
        return count

    def _of(self, rule: Callable[[Subject], Iterable[str]], subject: Subject, refusal: type[QuadcosimError]) -> int:
        count = 0
        try:
            texts = iter(rule(subject))
            for text in islice(texts, MOST):
                self.found(text)
                count += not isinstance(text, Note)
            if next(texts, None) is not None:
                self.found(Note(f"there are more; {MOST} are listed"))
        except refusal as error:
            self.found(str(error))
            count += 1
        return count


class Told:
    """What a report says."""

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        """`clock`: seconds of the process's own time."""
        self.findings: list[Finding] = []
        self.rule: str | None = None
        """The rule that was begun last"""
        self.ended = False
        self.error: str | None = None
        self.beaten: float | None = None
        """When a call of the FMU began or returned last, by the clock; None if there was none"""
        self._clock = clock

    def hear(self, frame: Frame) -> None:
        """What comes next."""
        name, *content = frame
        getattr(self, f"_{name}")(*content)

    def _begin(self, rule: str) -> None:
        self.rule = rule

    def _beat(self) -> None:
        self.beaten = self._clock()

    def _found(self, text: str, note: bool) -> None:
        self.findings.append(Finding(str(self.rule), text, note=note))

    def _failed(self, error: str) -> None:
        self.error = error

    def _end(self) -> None:
        self.ended = True
