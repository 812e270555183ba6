"""The process in which an FMU under validation runs: `python -m orchestration.validation.child FMU FOLDER REPORT`.

It writes a line of JSON to the report before each rule, for each finding and at the end, so that the report
is of use however far the process gets.
"""

import json
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import IO

from orchestration.validation import rules, runs
from orchestration.validation.archive import read_archive
from orchestration.validation.bench import Bench
from orchestration.validation.finding import Rule, name_of
from orchestration.validation.fmu import read_fmu
from orchestration.validation.instance import RefusedError

END = "end"
"""Stands where a rule would, when all have been tried"""
ERROR = "error"


def main(path: str, folder: str, report: str) -> None:
    """Try every rule on behaviour that is meant for the FMU."""
    bench = Bench(read_fmu(read_archive(Path(path))), Path(folder))
    with Path(report).open("a", encoding="utf-8", buffering=1) as out:
        try:
            if not any(_tried([rule], bench, out) for rule in runs.FIRST):
                _tried((*rules.OF_RUNS, *(rules.OUR_RUNS if bench.fmu.is_ours else ())), bench, out)
            _write(out, rule=END)
        except Exception as error:
            _write(out, **{ERROR: f"{type(error).__name__}: {error}"})
            raise


def _tried(chosen: Iterable[Rule[Bench]], bench: Bench, out: IO[str]) -> int:
    """How many findings there were."""
    count = 0
    for rule in chosen:
        _write(out, rule=name_of(rule))
        try:
            for text in rule(bench):
                _write(out, text=text)
                count += 1
        except RefusedError as error:
            _write(out, text=str(error))
            count += 1
    return count


def _write(out: IO[str], **line: str) -> None:
    out.write(json.dumps(line) + "\n")


if __name__ == "__main__":
    main(*sys.argv[1:])
