"""Loading an FMU for real, in a process of its own: one that cannot be loaded may well take its host down.

`python -m orchestration.doctor.trial FMU` does what the process does.
"""

import signal
import subprocess
import sys
from pathlib import Path

from orchestration import child
from orchestration.errors import QuadcosimError

PATIENCE = 120
"""Seconds for an FMU to instantiate and initialise."""


def attempt(fmu: Path) -> str | None:
    """Load and initialise an FMU in this Python; None if that went well, else what was said."""
    try:
        done = subprocess.run(
            child.command("orchestration.doctor.trial", fmu),
            capture_output=True, text=True, errors="replace", env=child.environment(), timeout=PATIENCE, check=False,
        )  # fmt: skip
    except subprocess.TimeoutExpired:
        return f"no answer within {PATIENCE} s"
    if done.returncode == 0:
        return None
    if done.returncode == 1 and done.stderr.strip():
        return done.stderr.strip().splitlines()[-1]
    return f"took its process down: {_ending(done.returncode)}"


def _ending(code: int) -> str:
    if code < 0:
        return signal.strsignal(-code) or f"signal {-code}"
    return f"exit code {code:#x}" if code > 255 else f"exit code {code}"


def main(arguments: list[str]) -> int:
    """Instantiate, initialise and free the FMU; 1 with the message as the last line if that is not to be."""
    from orchestration.fmpy_adapter import FmuSimulator

    try:
        with FmuSimulator(Path(arguments[0]), "doctor") as fmu:
            experiment = fmu.description.defaultExperiment
            start = float(experiment.startTime or 0.0) if experiment is not None else 0.0
            fmu.enter_initialization(start, start + 1.0)
            fmu.exit_initialization()
    except QuadcosimError as error:
        print(" ".join(str(error).split()), file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
