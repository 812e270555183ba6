"""A command in a process that is forked from this one, which has the shim and never runs a command itself."""

import atexit
import gc
import importlib
import os
import select
import signal
import sys
import tempfile
import time
import traceback
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from orchestration.command import cli
from tests.faults import forked_servers
from tests.faults.shim import Plan

STILL = 90
"""[s] in which a process that neither computes nor waits for the disk is taken to hang"""
MOST = 200.0
"""[s] of processor time after which one is taken not to end"""


@dataclass(frozen=True)
class End:
    """How a command ended."""

    code: int
    errors: str
    hangs: bool = False


def run(words: tuple[str, ...], place: Path, plan: Plan) -> End:
    """Run a command in the folder `work` of a place, with its folder `tmp` for temporary files, as planned."""
    printed = plan.path.with_name("printed")
    child = os.fork()
    if child == 0:
        _be_the_command(words, place, printed, plan)
    hangs = not _ends(child)
    with suppress(ProcessLookupError):
        os.killpg(child, signal.SIGKILL)
    status = os.waitpid(child, 0)[1]
    return End(os.waitstatus_to_exitcode(status), printed.read_text(errors="replace"), hangs)


def know_modules(plan: Plan) -> None:
    """Import what the last command imported, so that the next ones need not."""
    with suppress(FileNotFoundError):
        for name in _modules(plan).read_text().splitlines():
            if name not in sys.modules:
                with suppress(Exception):
                    importlib.import_module(name)
    gc.freeze()


def _modules(plan: Plan) -> Path:
    return plan.path.with_name("modules")


def _be_the_command(words: tuple[str, ...], place: Path, printed: Path, plan: Plan) -> None:
    """Run the command in this forked process, and end with it."""
    code = 1
    try:
        os.setsid()
        output = os.open(printed, os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
        os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
        for stream in (1, 2):
            os.dup2(output, stream)
        os.chdir(place / "work")
        os.environ["TMPDIR"] = str(place / "tmp")
        tempfile.tempdir = str(place / "tmp")  # Python would try it out, and leave the attempt there if killed
        plan.load()
        forked_servers.install()
        try:
            cli.main(list(words))
            code = 0
        except SystemExit as end:
            code = end.code if isinstance(end.code, int) else int(end.code is not None)
        atexit._run_exitfuncs()
        sys.stdout.flush()
        _modules(plan).write_text("\n".join(_importable()))
    except BaseException:
        traceback.print_exc()
    finally:
        with suppress(Exception):
            sys.stderr.flush()
        os._exit(code)


def _importable() -> list[str]:
    return [name for name, module in list(sys.modules.items()) if getattr(module, "__spec__", None) is not None]


def _ends(child: int) -> bool:
    """Wait for a process; whether it ends by itself."""
    handle = os.pidfd_open(child)
    try:
        poll = select.poll()
        poll.register(handle, select.POLLIN)
        used, since = -1.0, time.monotonic()
        while not poll.poll(1000):
            now, waits = _use_of(child)
            if now > MOST:
                return False
            if now != used or not waits:
                used, since = now, time.monotonic()
            elif time.monotonic() - since > STILL:
                return False
        return True
    finally:
        os.close(handle)


def _use_of(session: int) -> tuple[float, bool]:
    """The processor time of a session's processes [s], and whether all of them sleep."""
    used, waits = 0.0, True
    for path in Path("/proc").glob("[0-9]*/stat"):
        with suppress(OSError):
            fields = path.read_text().rpartition(")")[2].split()
            if int(fields[3]) == session:
                used += (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")
                waits &= fields[0] not in "RD"
    return used, waits
