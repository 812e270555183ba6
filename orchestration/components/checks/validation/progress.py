"""The report of the confined process to the one that waits for it: findings as they come, and returning calls."""

import time
from collections.abc import Callable, Iterable
from itertools import islice
from typing import Any

from orchestration.components.checks.validation.finding import Finding, Note, Rule, Subject, name_of
from orchestration.foundation.basics.errors import SimulatorError
from orchestration.foundation.processes.typed_frames import call

MAX_FINDINGS = 100
"""Findings of one rule that are listed"""
MAX_FINDING_LENGTH = 1000
"""Characters of the text of a finding"""
_BEAT = 0.02
"""Least time between two beats [s]"""
_MESSAGES = ("begin", "beat", "finding", "crashed", "failed", "end")
"""Methods of `ReceivedReport` that a message may name"""
Frame = tuple[Any, ...]
"""One of these, and its arguments"""


class Reporter:
    """Sends the beginning of each rule, findings and the end as they occur: of use however far the process gets."""

    def __init__(self, send: Callable[[Frame], None]) -> None:
        self._send = send
        self._next = 0.0

    def begin(self, rule: str) -> None:
        """A rule begins."""
        self._send(("begin", rule))

    def beat(self, reached: float | None = None) -> None:
        """A call of the FMU begins or has returned; it begins a step at the time `reached` [s], if that is given."""
        now = time.monotonic()
        if now >= self._next or reached is not None:
            self._next = now + _BEAT
            self._send(("beat", reached))

    def finding(self, text: str) -> None:
        """The rule has a finding."""
        whole = text if len(text) <= MAX_FINDING_LENGTH else f"{text[:MAX_FINDING_LENGTH]} ..."
        self._send(("finding", whole, isinstance(text, Note)))

    def crashed(self, place: str) -> None:
        """The C of the FMU crashes at a place."""
        self._send(("crashed", place))

    def failed(self, error: Exception) -> None:
        """The validation itself fails."""
        self._send(("failed", f"{type(error).__name__}: {error}"))

    def end(self) -> None:
        """All rules have been tried."""
        self._send(("end",))

    def try_rules(self, chosen: Iterable[Rule[Subject]], subject: Subject) -> int:
        """Try rules; the number of problems that they find. A refused call of the FMU counts, too."""
        count = 0
        for rule in chosen:
            self.begin(name_of(rule))
            count += self._try(rule, subject)
        return count

    def _try(self, rule: Callable[[Subject], Iterable[str]], subject: Subject) -> int:
        count = 0
        try:
            texts = iter(rule(subject))
            for text in islice(texts, MAX_FINDINGS):
                self.finding(text)
                count += not isinstance(text, Note)
            if next(texts, None) is not None:
                self.finding(Note(f"there are more; {MAX_FINDINGS} are listed"))
        except SimulatorError as error:
            self.finding(str(error))
            count += 1
        return count


class ReceivedReport:
    """The content of a report, as received."""

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        """`clock`: seconds of the process's own time."""
        self.findings: list[Finding] = []
        self.rule: str | None = None
        """the one begun last"""
        self.ended = False
        self.error: str | None = None
        self.place = ""
        """Place where its C crashed; empty: it has not, or no line is known"""
        self.last_beat: float | None = None
        """Time at which a call of the FMU last began or returned, by the clock; None if there was none"""
        self.reached: float | None = None
        """Time at which the FMU began its last step in this rule [s]; None if there was none"""
        self._clock = clock

    def receive(self, frame: Frame) -> None:
        """The next frame; raises `FrameError` if it is none."""
        call(self, frame, _MESSAGES)

    def begin(self, rule: str) -> None:
        """A rule begins."""
        self.rule, self.reached = rule, None

    def beat(self, reached: float | None) -> None:
        """A call begins or has returned, or a step begins at a time."""
        self.last_beat = self._clock()
        self.reached = self.reached if reached is None else reached

    def finding(self, text: str, note: bool) -> None:
        """The rule has a finding."""
        self.findings.append(Finding(str(self.rule), text, note=note))

    def crashed(self, place: str) -> None:
        """The C of the FMU crashes at a place."""
        self.place = place

    def failed(self, error: str) -> None:
        """The validation itself fails."""
        self.error = error

    def end(self) -> None:
        """All rules have been tried."""
        self.ended = True
