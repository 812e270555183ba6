"""All rules, tried in a confined process: a crash is a finding, and so is a missing answer."""

from pathlib import Path

from fmu_kit.scratch import temporary_folder
from orchestration.components.checks.validation.finding import Finding
from orchestration.components.checks.validation.progress import ReceivedReport
from orchestration.foundation.basics.errors import QuadcosimError
from orchestration.foundation.processes import subprocesses
from orchestration.foundation.processes.child import Child, Ending
from orchestration.foundation.processes.resource_limits import Limits

PROCESS = "process"
"""Rule of this module: the process of the FMU reaches its end"""
_HANGS = 0.5
"""Share of the time limit after which a call is taken for one that does not return"""


def validate(path: str | Path, *, limits: Limits | None = None) -> list[Finding]:
    """The problems of the FMU (FMI 2.0 or 3.0) at `path`; an empty list for a valid one.

    It is checked by co-simulation, or by model exchange if it offers that only.

    The file is read, and the FMU is run, in a separate process within `limits`. Rules of this project beyond the
    standard apply to FMUs that quadcosim built. Raises `QuadcosimError` if the validation itself fails.
    """
    path, limits = Path(path), limits or Limits()
    with temporary_folder() as folder:
        module = subprocesses.Module.of(
            "orchestration.components.checks.validation.confined_process",
            path.resolve(),
            folder,
            limits.time,
            limits.size,
        )
        with Child(module, limits=limits) as child:
            received = ReceivedReport(lambda: child.spent)
            ending = child.receive_all(received.receive)
    silent = None if received.last_beat is None else child.spent - received.last_beat
    if received.error is not None or (received.rule is None and ending.code is not None):
        raise QuadcosimError(f"{path}: the validation failed: {received.error or ending.last_line}")
    return [*received.findings, *_of_ending(received, ending, silent, limits)]


def _of_ending(received: ReceivedReport, ending: Ending, silent: float | None, limits: Limits) -> list[Finding]:
    """The findings from the end of the process.

    `silent`: seconds of the process's time since a call of the FMU began or returned; None if there was none.
    """
    place = f", at {received.place}" if received.place else ""
    moment = "after the last rule" if received.ended else f"in {received.rule or 'reading'}"
    if received.reached is not None and not received.ended:
        moment = f"{moment}, after t = {received.reached:g} s"
    if ending.code is None:
        hangs = silent is not None and silent > _HANGS * limits.time
        why = ""
        if ending.out_of_time and silent is not None:
            why = "a call does not return" if hangs else "its calls return, it is slow"
        text = "; ".join(filter(None, (f"stopped {moment}{place}: {ending.reached}", why, "the rest was not checked")))
        return [Finding(PROCESS, text)]
    if ending.code == 0 and received.ended:
        return []
    return [Finding(PROCESS, f"the process of the FMU {ending.description} {moment}{place}")]
