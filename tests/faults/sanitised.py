"""The C of engines, lanes, timetable and scheduler under AddressSanitizer and UndefinedBehaviorSanitizer.

`python -m tests.faults.sanitised` runs the tests over random systems with examples of their own in each run.
"""

import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

TESTS = (
    "tests/orchestration/systems/schedule/test_compiled_timetable.py",
    "tests/orchestration/systems/computers/test_compiled_scheduler.py",
    "tests/orchestration/simulation/engines/test_compiled.py",
    "tests/orchestration/simulation/engines/test_on_computers.py",
    "tests/orchestration/simulation/engines/batch/test_signals.py",
)
CHECKED = "-fsanitize=address,undefined -fno-sanitize-recover=undefined"
"""What is not defined ends the process, as what is not its memory does anyway."""


def compiler_into(folder: Path) -> None:
    """A `cc` that compiles as the one of this machine, with checks."""
    cc = folder / "cc"
    cc.write_text(f'#!/bin/sh\nexec {shutil.which("cc")} {CHECKED} "$@"\n', encoding="utf-8")
    cc.chmod(0o755)


def environment(folder: Path) -> dict[str, str]:
    """That of a Python whose C is compiled with checks, into a cache of its own."""
    libraries = (f"lib{name}.so" for name in ("asan", "ubsan"))
    paths = (subprocess.check_output(["cc", f"-print-file-name={name}"], text=True).strip() for name in libraries)
    there = {name: value for name, value in os.environ.items() if name != "CI"}  # where it is set, examples are fixed
    return {
        **there,
        "PATH": f"{folder}{os.pathsep}{os.environ['PATH']}",
        "XDG_CACHE_HOME": str(folder / "cache"),
        "LD_PRELOAD": " ".join(paths),
        "ASAN_OPTIONS": "detect_leaks=0",  # Python's own
        "UBSAN_OPTIONS": "print_stacktrace=1",
    }


def run(*words: str) -> int:
    """Run the tests over random systems; the exit code of pytest."""
    with tempfile.TemporaryDirectory() as folder:
        compiler_into(Path(folder))
        command = [
            sys.executable,
            "-m",
            "pytest",
            "-q",
            "-p",
            "no:cacheprovider",
            "--capture=sys",
            "-k",
            "random",
            *TESTS,
            *words,
        ]
        return subprocess.run(command, env=environment(Path(folder)), check=False).returncode


if __name__ == "__main__":
    sys.exit(run(*sys.argv[1:]))
