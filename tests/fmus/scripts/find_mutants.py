"""Validate mutants that run, each in a process of its own; print what was found wrong with each.

Of the rules that run an FMU those are tried that the others stand on, and the one that is meant for the mutant.
"""

import functools
import json
import os
import sys
import tempfile
from collections.abc import Callable, Iterable
from pathlib import Path

from orchestration.components.checks.validation import confined_process, description, rules, run_rules, structure
from orchestration.components.checks.validation.finding import Rule, Subject, name_of
from orchestration.components.checks.validation.progress import Frame, ReceivedReport, Reporter
from orchestration.foundation.processes.resource_limits import Limits
from tests.fmus.damage import Mutant
from tests.fmus.mutants import MUTANTS
from tests.fmus.process import in_a_copy

STATIC: list[Callable[..., object]] = [
    *rules.OF_ARCHIVES,
    description.standard,
    structure.indices,
    *rules.OF_DESCRIPTIONS,
    *rules.OUR_DESCRIPTIONS,
]
WITHOUT_INSTANCES = {confined_process.READABLE, *map(name_of, STATIC)}
"""Rules that look at the archive and the description: for their mutants nothing needs to run"""
FindingRow = tuple[str, str, bool]
"""Rule, text and whether it is a note"""
_ALWAYS = {*WITHOUT_INSTANCES, *map(name_of, run_rules.FIRST)}


class Narrowed(Reporter):
    """Tries only one of the rules that run an FMU, and those that the others rely on."""

    def __init__(self, send: Callable[[Frame], None], rule: str) -> None:
        super().__init__(send)
        self._chosen = {*_ALWAYS, rule}

    def try_rules(self, chosen: Iterable[Rule[Subject]], subject: Subject) -> int:
        """Only the chosen ones."""
        return super().try_rules([rule for rule in chosen if name_of(rule) in self._chosen], subject)


def found(mutant: Mutant, path: Path) -> list[FindingRow]:
    """What the rules find that are tried on it."""
    received = ReceivedReport()
    with tempfile.TemporaryDirectory() as folder:
        limits = Limits(time=mutant.time_limit)
        confined_process.check(path, Path(folder), limits, Narrowed(received.receive, mutant.rule))
    return [(finding.rule, finding.text, finding.note) for finding in received.findings]


def main(folder: Path, built: dict[str, Path], names: list[str]) -> dict[str, list[FindingRow]]:
    answers = {}
    for mutant in (mutant for mutant in MUTANTS if mutant.name in names):
        path = mutant.write(built[mutant.model], folder)
        answers[mutant.name] = in_a_copy(functools.partial(found, mutant, path))
    return answers


if __name__ == "__main__":
    where, fmus, *chosen = sys.argv[1:]
    print(json.dumps(main(Path(where), {path.stem: path for path in map(Path, fmus.split(os.pathsep))}, chosen)))
