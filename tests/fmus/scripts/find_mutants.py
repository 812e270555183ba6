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

from orchestration.basics.errors import QuadcosimError
from orchestration.checks.validation import confined_process, description, rules, run_rules
from orchestration.checks.validation.finding import Rule, Subject, name_of
from orchestration.checks.validation.progress import Frame, Report, Told
from orchestration.processes.limits import Limits
from tests.fmus.damage import Mutant
from tests.fmus.mutants import MUTANTS
from tests.fmus.process import in_a_copy

STATIC: list[Callable[..., object]] = [*rules.OF_ARCHIVES, description.standard, *rules.OF_DESCRIPTIONS]
WITHOUT_INSTANCES = {confined_process.READABLE, *map(name_of, [*STATIC, *rules.OUR_DESCRIPTIONS])}
"""Rules that look at the archive and the description: for their mutants nothing needs to run"""
Said = tuple[str, str, bool]
"""Rule, text and whether it is a note"""
_ALWAYS = {*WITHOUT_INSTANCES, *map(name_of, run_rules.FIRST)}


class Narrowed(Report):
    """Tries of the rules that run an FMU, but for those that the others stand on, one only."""

    def __init__(self, say: Callable[[Frame], None], rule: str) -> None:
        super().__init__(say)
        self._wanted = {*_ALWAYS, rule}

    def tried(self, chosen: Iterable[Rule[Subject]], subject: Subject, refusal: type[QuadcosimError]) -> int:
        """Of those that are wanted."""
        return super().tried([rule for rule in chosen if name_of(rule) in self._wanted], subject, refusal)


def found(mutant: Mutant, path: Path) -> list[Said]:
    """What the rules find that are tried on it."""
    told = Told()
    with tempfile.TemporaryDirectory() as folder:
        limits = Limits(time=mutant.time_limit)
        confined_process.check(path, Path(folder), limits, Narrowed(told.hear, mutant.rule))
    return [(finding.rule, finding.text, finding.note) for finding in told.findings]


def main(folder: Path, built: dict[str, Path], names: list[str]) -> dict[str, list[Said]]:
    answers = {}
    for mutant in (mutant for mutant in MUTANTS if mutant.name in names):
        path = mutant.write(built[mutant.model], folder)
        answers[mutant.name] = in_a_copy(functools.partial(found, mutant, path))
    return answers


if __name__ == "__main__":
    where, fmus, *chosen = sys.argv[1:]
    print(json.dumps(main(Path(where), {path.stem: path for path in map(Path, fmus.split(os.pathsep))}, chosen)))
