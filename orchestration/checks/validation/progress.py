"""What the confined process tells the one that waits for it: findings as they come, and that calls return."""

import contextlib
import json
import mmap
import struct
import time
from collections.abc import Callable, Iterable
from itertools import islice
from pathlib import Path

from orchestration.basics.errors import QuadcosimError
from orchestration.checks.validation.finding import Finding, Note, Rule, Subject, name_of

REPORT, PULSE = "report", "pulse"
"""Names of the files"""
MOST = 100
"""Findings of one rule that are listed"""
LONGEST = 1000
"""Characters of the text of a finding"""
_MOST_BYTES = 50_000_000
_MOMENT = struct.Struct("d")


class Report:
    """A file with a line before each rule, for each finding and at the end: of use however far the process gets."""

    def __init__(self, path: Path) -> None:
        self._out = path.open("a", encoding="utf-8", buffering=1)

    def rule(self, name: str) -> None:
        """A rule begins."""
        self._write(rule=name)

    def found(self, text: str) -> None:
        """The rule finds something."""
        whole = text if len(text) <= LONGEST else f"{text[:LONGEST]} ..."
        self._write(text=whole, note=isinstance(text, Note))

    def failed(self, error: Exception) -> None:
        """The validation itself fails."""
        self._write(error=f"{type(error).__name__}: {error}")
        self._out.close()

    def end(self) -> None:
        """All there is to try has been tried."""
        self._write(end=True)
        self._out.close()

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

    def _write(self, **line: object) -> None:
        self._out.write(json.dumps(line) + "\n")


class Told:
    """What a report says."""

    def __init__(self, path: Path) -> None:
        self.findings: list[Finding] = []
        self.rule: str | None = None
        """The rule that was begun last"""
        self.ended = False
        self.error: str | None = None
        with path.open("rb") as stream:
            content = stream.read(_MOST_BYTES).decode("utf-8", "replace")
        for text in content.split("\n")[:-1]:
            with contextlib.suppress(ValueError, KeyError, AttributeError):  # the FMU could write to it as well
                self._take(json.loads(text))

    def _take(self, line: dict[str, str]) -> None:
        self.rule = line.get("rule", self.rule)
        self.ended = self.ended or bool(line.get("end"))
        self.error = self.error or line.get("error")
        if "text" in line:
            self.findings.append(Finding(str(self.rule), line["text"], note=bool(line["note"])))


class Pulse:
    """A file with the moment at which a call of the FMU began last, by a clock that all processes share."""

    def __init__(self, path: Path) -> None:
        path.write_bytes(_MOMENT.pack(0.0))
        with path.open("r+b") as stream:
            self._memory = mmap.mmap(stream.fileno(), _MOMENT.size)

    def beat(self) -> None:
        """A call begins or has returned."""
        _MOMENT.pack_into(self._memory, 0, time.monotonic())


def since_last_beat(path: Path) -> float | None:
    """Seconds since a call of the FMU began or returned; None if there was none."""
    try:
        (moment,) = _MOMENT.unpack(path.read_bytes())
    except (OSError, struct.error):
        return None
    return time.monotonic() - float(moment) if moment else None
