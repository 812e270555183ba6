"""The confined process that does all that touches the FMU.

`python -m orchestration.checks.validation.confined_process FMU FOLDER SECONDS MB` unpacks the FMU in the folder, an
empty one, and says what it finds (see `progress`).
"""

import sys
from pathlib import Path

import fmpy

from orchestration.checks.validation import rules, run_rules
from orchestration.checks.validation.archive_rules import can_be_unpacked
from orchestration.checks.validation.description import standard
from orchestration.checks.validation.fmu import Fmu
from orchestration.checks.validation.instance import RefusedError
from orchestration.checks.validation.own_description import own_description
from orchestration.checks.validation.probe import Probe
from orchestration.checks.validation.progress import Report
from orchestration.checks.validation.reading import read_co_simulation, read_fmu
from orchestration.fmi.archive import UnreadableFmuError, read_archive
from orchestration.fmi.pythonfmu import expect_readable_place
from orchestration.fmi.slaves import FOLDERS
from orchestration.processes.channel import Parent
from orchestration.processes.limits import Limits, restrict

READABLE, PLATFORM = "readable", "platform"
"""Rules that are kept here: there is an FMU to look at, and this machine can run it"""


def main(path: str, folder: str, time: str, size: str) -> None:
    """Try every rule that is meant for the FMU; limits in [s] and [MB]."""
    check(Path(path), Path(folder), Limits(time=float(time), size=float(size)), Report(Parent().send))


def check(path: Path, folder: Path, limits: Limits, report: Report) -> None:
    """Try every rule that is meant for the FMU; raises what fails in a rule itself."""
    restrict(limits.size)
    try:
        fmu = look(path, limits.size, report)
        if fmu is not None and can_be_unpacked(fmu.archive):
            fmpy.extract(str(path), str(folder))
            expect_readable_place(folder)
            _run(Probe(fmu, folder, limits.time, report.beat), report)
        report.end()
    except Exception as error:
        report.failed(error)
        raise


def look(path: Path, size_limit: float, report: Report) -> Fmu | None:
    """Try the rules that need no instance; None if there is no FMU to be read."""
    report.rule(READABLE)
    try:
        archive = read_archive(path, size_limit)
        report.tried(rules.OF_ARCHIVES, archive, RefusedError)
        root = read_co_simulation(archive)
        report.tried((standard,), archive, RefusedError)
        fmu = read_fmu(archive, root)
    except UnreadableFmuError as error:
        report.rule(READABLE)
        report.found(str(error))
        return None
    report.tried((*rules.OF_DESCRIPTIONS, *(rules.OUR_DESCRIPTIONS if fmu.is_ours else ())), fmu, RefusedError)
    return fmu


def _run(probe: Probe, report: Report) -> None:
    fmu = probe.fmu
    if fmu.is_ours:
        report.tried((own_description,), probe, RefusedError)
    here, platforms = FOLDERS[fmu.version], fmu.platforms
    if not set(here) & set(platforms):
        report.rule(PLATFORM)
        missing = f"expected a binary for {' or '.join(here)}, found {', '.join(platforms) or 'none'}"
        report.found(f"what the FMU does was not checked: {missing}")
        return
    if any(report.tried([rule], probe, RefusedError) for rule in run_rules.FIRST):
        return
    report.tried(rules.OF_RUNS, probe, RefusedError)
    if probe.repeats is None:
        report.tried(rules.OF_EQUAL_RUNS, probe, RefusedError)
    report.tried(rules.LAST_OF_RUNS, probe, RefusedError)
    if fmu.is_ours:
        report.tried(rules.OUR_RUNS, probe, RefusedError)


if __name__ == "__main__":
    main(*sys.argv[1:])
