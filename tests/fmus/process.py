"""Python programs in a process of their own: for what would crash, leak into or mislead the test process."""

import json
import os
import signal
import subprocess
import sys
import traceback
from collections.abc import Callable
from pathlib import Path
from typing import Any

from tests.patience import PATIENCE
from tests.places import ROOT


def run(
    *arguments: str, cwd: Path = ROOT, environment: dict[str, str] | None = None
) -> subprocess.CompletedProcess[str]:
    """A program to its end, whatever that is; `environment` is added to this process's own."""
    return subprocess.run(
        arguments, cwd=cwd, env={**os.environ, **(environment or {})}, capture_output=True, text=True, timeout=PATIENCE
    )


def run_script(name: str, *arguments: str | Path) -> Any:
    """What the script of that name prints last as JSON, in a line; fails the test if it does not end well."""
    module = f"tests.fmus.scripts.{name}"
    done = run(sys.executable, "-X", "faulthandler", "-m", module, *map(str, arguments))
    assert done.returncode == 0, f"{module} ended with {done.returncode}:\n{done.stdout[-2000:]}\n{done.stderr[-4000:]}"
    said = next(
        line for line in reversed(done.stdout.splitlines()) if line[:1] in "[{"
    )  # C libraries print as they end
    return json.loads(said)


def in_a_copy(call: Callable[[], Any]) -> Any:
    """What a call in a copy of this process returns, as JSON: for a script that tries many things, each from the start.

    Raises `ChildProcessError` where it does not return.
    """
    reading, writing = os.pipe()
    sys.stdout.flush()
    if os.fork() == 0:
        try:
            os.dup2(2, 1)  # what it prints is not this process's answer
            signal.alarm(round(PATIENCE))
            answer = json.dumps(call()).encode()
            with open(writing, "wb") as pipe:
                pipe.write(answer)
        except BaseException:
            traceback.print_exc()
        finally:
            os._exit(0)
    os.close(writing)
    with open(reading, "rb") as pipe:
        said = pipe.read()
    _, status = os.wait()
    if not said:
        raise ChildProcessError(f"a copy of the process has ended with {status} and no answer")
    return json.loads(said)
