"""The confined process, which alone touches the FMU.

`python -m orchestration.components.checks.validation.confined_process FMU FOLDER SECONDS MB` unpacks the FMU in
the folder, an empty one, and reports its findings (see `progress`).
"""

import contextlib
import sys
from pathlib import Path

import fmpy

from orchestration.components.checks.validation import rules, run_rules
from orchestration.components.checks.validation.archive_rules import can_be_unpacked
from orchestration.components.checks.validation.description import standard
from orchestration.components.checks.validation.fmu import Fmu, read_fmu
from orchestration.components.checks.validation.other_interfaces import run_of_fmi1, trials_of_fmi1
from orchestration.components.checks.validation.own_rules import own_description
from orchestration.components.checks.validation.probe import Probe
from orchestration.components.checks.validation.progress import Reporter
from orchestration.components.checks.validation.structure import indices
from orchestration.components.fmi.access import SCHEDULED
from orchestration.components.fmi.archive import (
    DESCRIPTION,
    UnreadableFmuError,
    read_archive,
    read_checked_root,
    read_root,
)
from orchestration.components.fmi.crashes import report_crashes
from orchestration.components.fmi.read_description import Model, declared_of, read_model
from orchestration.components.fmi.slaves import FOLDERS, expect_readable_place
from orchestration.foundation.basics.errors import UsageError
from orchestration.foundation.processes.channel import Parent
from orchestration.foundation.processes.resource_limits import Limits, restrict

_KINDS = ("CoSimulation", "ModelExchange", "ScheduledExecution")
READABLE, PLATFORM = "readable", "platform"
"""Rules of this module: the FMU is readable, and this machine can run it"""


def main(path: str, folder: str, time: str, size: str) -> None:
    """Try every rule that applies to the FMU; limits in [s] and [MB]."""
    reporter = Reporter(Parent().send)
    report_crashes(reporter.crashed)
    check(Path(path), Path(folder), Limits(time=float(time), size=float(size)), reporter)


def check(path: Path, folder: Path, limits: Limits, report: Reporter) -> None:
    """Try every rule that applies to the FMU; raises an error of a rule itself."""
    restrict(limits.size)
    try:
        if _is_of_fmi1(path, limits.size):
            _check_fmi1(path, limits, report)
            report.end()
            return
        fmu = check_description(path, limits.size, report)
        model = None if fmu is None else _model_of(fmu, report)
        if fmu is not None and model is not None and can_be_unpacked(fmu.archive):
            fmpy.extract(str(path), str(folder))
            expect_readable_place(folder)
            _run(Probe(fmu, model, folder, limits.time, report.beat), report)
        report.end()
    except Exception as error:
        report.failed(error)
        raise


def _is_of_fmi1(path: Path, size_limit: float) -> bool:
    with contextlib.suppress(UnreadableFmuError):
        return read_root(read_archive(path, size_limit)).get("fmiVersion") == "1.0"
    return False


def _check_fmi1(path: Path, limits: Limits, report: Reporter) -> None:
    """Read an FMU of FMI 1.0, and run it, if it is one for co-simulation; rules are for later versions."""
    report.begin(READABLE)
    archive = read_archive(path, limits.size)
    report.try_rules(rules.OF_ARCHIVES, archive)
    report.begin(READABLE)
    try:
        model = read_model(path)
    except UsageError as error:
        report.finding(f"fmiVersion = 1.0: {str(error).removeprefix(f'{path}: ')}")
        return
    if can_be_unpacked(archive):
        report.try_rules((run_of_fmi1,), trials_of_fmi1(model, limits.time, report.beat))


def check_description(path: Path, size_limit: float, report: Reporter) -> Fmu | None:
    """Try the rules that need no instance; None if the FMU is unreadable."""
    report.begin(READABLE)
    try:
        archive = read_archive(path, size_limit)
        report.try_rules(rules.OF_ARCHIVES, archive)
        root = read_checked_root(archive)
        if all(root.find(kind) is None for kind in _KINDS):
            raise UnreadableFmuError(f"{DESCRIPTION}: expected {' or '.join(_KINDS)}, nothing else was checked")
        report.try_rules((standard,), archive)
        if report.try_rules((indices,), root):
            return None
        fmu = read_fmu(archive, root)
    except UnreadableFmuError as error:
        report.begin(READABLE)
        report.finding(str(error))
        return None
    report.try_rules((*rules.OF_DESCRIPTIONS, *(rules.OUR_DESCRIPTIONS if fmu.is_ours else ())), fmu)
    return fmu


def _model_of(fmu: Fmu, report: Reporter) -> Model | None:
    """The FMU as the master reads it; None if it refuses that."""
    try:
        return read_model(fmu.archive.path)
    except UsageError as error:
        report.begin(READABLE)
        report.finding(str(error).removeprefix(f"{fmu.archive.path}: "))
        return None


def _run(probe: Probe, report: Reporter) -> None:
    fmu = probe.fmu
    if fmu.is_ours:
        report.try_rules((own_description,), probe)
    here, platforms = FOLDERS[fmu.version], fmu.platforms
    if not set(here) & set(platforms):
        report.begin(PLATFORM)
        missing = f"expected a binary for {' or '.join(here)}, found {', '.join(platforms) or 'none'}"
        report.finding(f"the behaviour of the FMU was not checked: {missing}")
        return
    if [*declared_of(fmu.description)] == [SCHEDULED]:
        report.try_rules(rules.OF_OTHER_INTERFACES, probe)
        return
    if any(report.try_rules([rule], probe) for rule in run_rules.FIRST):
        report.try_rules(rules.OF_OTHER_INTERFACES, probe)
        return
    report.try_rules(rules.OF_RUNS, probe)
    if probe.repeats is None:
        report.try_rules(rules.OF_EQUAL_RUNS, probe)
        report.try_rules(rules.OF_OTHER_INTERFACES, probe)
    report.try_rules(rules.LAST_OF_RUNS, probe)
    if fmu.is_ours:
        report.try_rules(rules.OUR_RUNS, probe)


if __name__ == "__main__":
    main(*sys.argv[1:])
