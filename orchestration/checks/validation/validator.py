"""All rules, tried in a confined process: a crash is a finding, and so is no answer in time."""

import tempfile
from pathlib import Path

from orchestration.basics.errors import QuadcosimError
from orchestration.checks.validation.finding import Finding
from orchestration.checks.validation.progress import Told
from orchestration.processes import subprocesses
from orchestration.processes.child import Child, Ending
from orchestration.processes.limits import Limits

PROCESS = "process"
"""Rule that is kept here: the process of the FMU lives to its end"""
_HANGS = 0.5
"""Share of the time limit that one call may take before it is taken for one that does not return"""


def validate(path: str | Path, *, limits: Limits | None = None) -> list[Finding]:
    """What is wrong with the FMU for co-simulation (FMI 2.0 or 3.0) at `path`; nothing for one that is as it should be.

    All that touches the file is done, and the FMU is run, in a process of its own within `limits`. Rules that are
    this project's and not the standard's are for FMUs that quadcosim built. Raises `QuadcosimError` if the
    validation fails itself.
    """
    path, limits = Path(path), limits or Limits()
    with tempfile.TemporaryDirectory(prefix="quadcosim-", ignore_cleanup_errors=True) as folder:
        module = subprocesses.Module.of(
            "orchestration.checks.validation.confined_process", path.resolve(), folder, limits.time, limits.size
        )
        with Child(module, limits=limits) as child:
            told = Told(lambda: child.spent)
            ending = child.receive_all(told.hear)
    silent = None if told.beaten is None else child.spent - told.beaten
    if told.error is not None or (told.rule is None and ending.code is not None):
        raise QuadcosimError(f"{path}: it is the validation that failed: {told.error or ending.last_line}")
    return [*told.findings, *_of_ending(told, ending, silent, limits)]


def _of_ending(told: Told, ending: Ending, silent: float | None, limits: Limits) -> list[Finding]:
    """What the end of the process says of the FMU.

    `silent`: seconds of the process's time since a call of the FMU began or returned; None if there was none.
    """
    moment = "after the last rule" if told.ended else f"in {told.rule or 'reading'}"
    if ending.code is None:
        hangs = silent is not None and silent > _HANGS * limits.time
        why = ""
        if ending.out_of_time and silent is not None:
            why = "a call does not return" if hangs else "its calls return, it is slow"
        text = "; ".join(filter(None, (f"stopped {moment}: {ending.reached}", why, "the rest was not checked")))
        return [Finding(PROCESS, text)]
    if ending.code == 0 and told.ended:
        return []
    return [Finding(PROCESS, f"the process of the FMU {ending.description} {moment}")]
