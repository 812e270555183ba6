"""The report on FMUs and this machine."""

import dataclasses
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from orchestration.components.checks.doctor.binaries import newest
from orchestration.components.checks.doctor.dependencies import part_for
from orchestration.components.checks.doctor.loading import Trial, try_loading
from orchestration.components.checks.doctor.machine import Library, Machine, this_machine
from orchestration.components.checks.doctor.verdict import UnexaminedFmu, Verdict, judge
from orchestration.components.fmi.archive import OtherVersionError
from orchestration.foundation.processes.resource_limits import Limits


@dataclass(frozen=True, kw_only=True)
class DoctorReport:
    """A machine, and the verdict on each FMU."""

    machine: Machine
    verdicts: tuple[Verdict | UnexaminedFmu, ...]

    @property
    def good(self) -> bool:
        """Whether every FMU loads and nothing is missing."""
        return all(verdict.good for verdict in self.verdicts)


def examine(paths: Iterable[Path], limits: Limits) -> DoctorReport:
    """Examine this machine, read the FMUs and try them within `limits`; `UsageError` for a file that is no FMU."""
    trials = [_trial_of(path, limits) for path in paths]
    machine = this_machine([trial.fmu for trial in trials if isinstance(trial, Trial)])
    return DoctorReport(machine=machine, verdicts=tuple(_verdict_on(trial, machine) for trial in trials))


def _trial_of(path: Path, limits: Limits) -> Trial | UnexaminedFmu:
    try:
        return try_loading(path, limits)
    except OtherVersionError as error:
        return UnexaminedFmu(path=path, failure=str(error))


def _verdict_on(trial: Trial | UnexaminedFmu, machine: Machine) -> Verdict | UnexaminedFmu:
    return trial if isinstance(trial, UnexaminedFmu) else judge(trial.fmu, machine, trial.failure)


def as_tables(report: DoctorReport) -> dict[str, Any]:
    """All facts, for `json.dumps`."""
    return {
        "machine": _plain(report.machine),
        "fmus": [_verdict_table(verdict, report.machine) for verdict in report.verdicts],
        "good": report.good,
    }


def _verdict_table(verdict: Verdict | UnexaminedFmu, machine: Machine) -> dict[str, Any]:
    if isinstance(verdict, UnexaminedFmu):
        return {**_plain(verdict), "loads": False, "good": False}
    part = part_for(verdict.fmu, machine)
    hosts = {"python": verdict.python_host, "other": verdict.other_host}
    return {
        **_plain(verdict.fmu),
        "platform_here": None if part is None else part.platform,
        "hosts": {name: {"ready": host.ready, **_plain(host)} for name, host in hosts.items()},
        "loads": verdict.failure is None,
        "failure": verdict.failure,
        "problems": list(verdict.problems),
        "elsewhere": list(verdict.elsewhere),
        "good": verdict.good,
    }


def _plain(value: Any) -> Any:
    """Dataclasses as tables, paths as text, sets as sorted lists; only the newest versions of a library."""
    if isinstance(value, Library):
        return {"path": str(value.path), "versions": list(newest(value.versions))}
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return {field.name: _plain(getattr(value, field.name)) for field in dataclasses.fields(value)}
    if isinstance(value, dict):
        return {key: _plain(entry) for key, entry in value.items()}
    if isinstance(value, (set, frozenset)):
        return sorted(value)
    if isinstance(value, (tuple, list)):
        return [_plain(entry) for entry in value]
    return str(value) if isinstance(value, Path) else value
