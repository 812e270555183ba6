"""What an FMU does, found out in a process of its own: a crash is a finding, and so is no answer in time."""

import json
import signal
import subprocess
import tempfile
from dataclasses import dataclass
from pathlib import Path

import fmpy

from orchestration import child
from orchestration.errors import QuadcosimError
from orchestration.validation.child import END, ERROR
from orchestration.validation.finding import Finding
from orchestration.validation.fmu import Fmu

PROCESS, PLATFORM = "process", "platform"
"""Rules that are kept here: the process lives, and this machine can run the FMU"""


def behaviour(fmu: Fmu, folder: Path, time_limit: float) -> list[Finding]:
    """What the child process finds in `time_limit` [s] on an FMU that was unpacked to `folder`, and how it ends.

    Raises `QuadcosimError` if it is not the FMU but the validation that fails.
    """
    platforms = fmpy.supported_platforms(str(fmu.archive.path))
    if fmpy.platform not in platforms:
        missing = f"expected a binary for {fmpy.platform}, found {', '.join(platforms) or 'none'}"
        return [Finding(PLATFORM, f"what the FMU does was not checked: {missing}")]
    with tempfile.TemporaryDirectory(prefix="quadcosim-") as place:
        report = Path(place) / "report"
        report.touch()
        ending = _run([str(fmu.archive.path.resolve()), str(folder), str(report)], time_limit)
        complete = report.read_text(encoding="utf-8").split("\n")[:-1]
    lines: list[dict[str, str]] = [json.loads(line) for line in complete]
    errors = [line[ERROR] for line in lines if ERROR in line]
    if errors or (ending.code and not lines):
        raise QuadcosimError(f"{fmu.archive.path}: it is the validation that failed: {[*errors, ending.said][0]}")
    return _findings(lines, ending, time_limit)


@dataclass(frozen=True, kw_only=True)
class _Ending:
    """How the child process ended."""

    code: int | None
    """Exit code, as the operating system gives it; None: it was stopped at the limit"""
    said: str
    """Its last words on standard error"""


def _run(arguments: list[str], time_limit: float) -> _Ending:
    with tempfile.TemporaryFile() as errors:
        try:
            code: int | None = subprocess.run(
                child.command("orchestration.validation.child", *arguments),
                env=child.environment(), timeout=time_limit, check=False,
                stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=errors,
            ).returncode  # fmt: skip
        except subprocess.TimeoutExpired:
            code = None
        errors.seek(0)
        said = errors.read().decode("utf-8", "replace").strip().splitlines()
    return _Ending(code=code, said=said[-1] if said else f"exit code {code}")


def _findings(lines: list[dict[str, str]], ending: _Ending, time_limit: float) -> list[Finding]:
    findings, rule = [], "loading"
    for line in lines:
        rule = line.get("rule", rule)
        if "text" in line:
            findings.append(Finding(rule, line["text"]))
    moment = "after the last rule" if rule == END else f"in {rule}"
    if ending.code is None:
        findings.append(Finding(PROCESS, f"no end within the limit of {time_limit:g} s, stopped {moment}"))
    elif ending.code != 0:
        how = f"by {signal.Signals(-ending.code).name}" if ending.code < 0 else f"with exit code {ending.code}"
        findings.append(Finding(PROCESS, f"the process of the FMU ended {how} {moment}"))
    return findings
