"""Commands at each of whose calls of the operating system something fails: what becomes of their files.

Each case is a process that is forked from this one, in a folder of its own, and then the command once more without a
fault. This process has the shim, and never runs a command itself.
"""

import atexit
import gc
import hashlib
import importlib
import os
import re
import select
import shutil
import signal
import sys
import tempfile
import time
import traceback
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from orchestration.command import cli
from tests.faults.commands import BEFORE, TEXTS, Command
from tests.faults.shim import FAULTS, KILL, Fault, Plan

OLD = b"years of work"
STILL = 90
"""[s] in which a process that neither computes nor waits for the disk is taken to hang"""
MOST = 200.0
"""[s] of processor time after which one is taken not to end"""
HIDDEN = re.compile(r"(^|/)\.quadcosim-|\.new$|\.partial$")
KEPT = re.compile(r"flight\.\d+(/|$)")
"""A whole run that could not take its place"""
JOURNALS = ("-wal", "-shm", ".lock")
"""Endings of files beside a store that are there or not"""

State = dict[str, str]
"""The digests of the files below a folder, by path; of folders without files a word"""


@dataclass(frozen=True)
class Row:
    """One case: the n-th call of a kind failed while a command ran."""

    command: str
    operation: str
    n: int
    outcome: str
    """`new` or `old`: what the files are like after it; else what is wrong"""
    note: str = ""


@dataclass(frozen=True)
class End:
    """How a command ended."""

    code: int
    errors: str
    hangs: bool = False


class Matrix:
    """Cases of commands, in a temporary folder."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.plan = Plan(folder / "plan")
        self._known: dict[str, Path] = {}
        self._count = 0

    def rows(self, command: Command, faults: Iterable[Fault] = FAULTS, most: int = 10**9) -> Iterator[Row]:
        """All cases of a command, with at most `most` numbers of a kind of call."""
        clean, again = self._clean(command), self._clean(command)
        varying = {name for name in clean.after if clean.after[name] != again.after.get(name)}
        after = _without(clean.after, varying)
        for fault in faults:
            for n in list(_numbers(fault, clean.calls[fault.call]))[:most]:
                row = self._case(command, fault, n, after, varying)
                if row is not None:
                    yield row

    def _clean(self, command: Command) -> "_Clean":
        place = self._place(command)
        end = self._run(command.words, place)
        if end.code != 0 or end.hangs:
            raise RuntimeError(f"{command.name} without a fault: code {end.code}: {end.errors}")
        calls = self.plan.calls()
        self._know_modules()
        state = _state(place / "work")
        shutil.rmtree(place)
        return _Clean(state, calls)

    def _case(self, command: Command, fault: Fault, n: int, after: State, varying: set[str]) -> Row | None:
        place = self._place(command)
        before = _state(place / "work")
        end = self._run(command.words, place, fault, n)
        if not self.plan.struck:
            shutil.rmtree(place)
            return None
        then = _without_hidden(_state(place / "work"))
        faults = list(_faults_of(end, fault))
        is_new = _without(then, varying) == after and set(then) >= set(after)
        outcome = "new" if is_new else "old"
        if end.code == 0 and not is_new and fault.how != KILL:
            faults.append(("silent", f"code 0, but {_difference(_without(then, varying), after)}"))
        elif not is_new and not command.resumes:
            faults += _lost(then, before, after, varying, killed=fault.how == KILL)
        if is_new and command.once:
            for name in {name.split("/")[0] for name in set(after) - set(before)}:
                shutil.rmtree(place / "work" / name)
        rerun = self._run(command.words, place)
        last = _state(place / "work")
        there = command.once and _without(last, varying) == after
        if (rerun.code != 0 and not there) or rerun.hangs:
            faults.append(("stuck", f"then: code {rerun.code}: {_last_line(rerun.errors)}"))
        elif _without(last, varying) != after:
            faults.append(("stuck", f"then: {_difference(_without(last, varying), after)}"))
        left = [str(path.relative_to(place)) for path in (place / "tmp").iterdir()]
        left += [name for name in last if HIDDEN.search(name)]
        if left:
            faults.append(("left", ", ".join(sorted(left)[:3])))
        shutil.rmtree(place)
        if faults:
            outcome = faults[0][0]
        return Row(command.name, f"{fault.call}: {fault.text}", n, outcome, "; ".join(note for _, note in faults))

    def _place(self, command: Command) -> Path:
        self._count += 1
        place = self.folder / f"case{self._count}"
        work = place / "work"
        work.mkdir(parents=True)
        (place / "tmp").mkdir()
        for name in command.needs:
            if name in TEXTS:
                (work / name).write_text(TEXTS[name], encoding="utf-8")
            else:
                shutil.copytree(self._made(name), work / name)
        for name in command.old:
            (work / name).parent.mkdir(exist_ok=True)
            (work / name).write_bytes(OLD)
        return place

    def _made(self, name: str) -> Path:
        if name not in self._known:
            place = self.folder / f"before-{name}"
            for each in ("tmp", "work"):
                (place / each).mkdir(parents=True)
            for file, text in TEXTS.items():
                (place / "work" / file).write_text(text, encoding="utf-8")
            end = self._run(BEFORE[name], place)
            if end.code != 0:
                raise RuntimeError(f"{name}: {end.errors}")
            self._known[name] = place / "work" / name
        return self._known[name]

    def _run(self, words: tuple[str, ...], place: Path, fault: Fault | None = None, n: int = 0) -> End:
        self.plan.write(place, fault, n)
        printed = self.folder / "printed"
        child = os.fork()
        if child == 0:
            _be_the_command(words, place, printed, self.plan, self.folder / "modules")
        hangs = not _ends(child)
        with suppress(ProcessLookupError):
            os.killpg(child, signal.SIGKILL)
        status = os.waitpid(child, 0)[1]
        return End(os.waitstatus_to_exitcode(status), printed.read_text(errors="replace"), hangs)

    def _know_modules(self) -> None:
        """Import what the last command imported, so that the next ones need not."""
        with suppress(FileNotFoundError):
            for name in (self.folder / "modules").read_text().splitlines():
                if name not in sys.modules:
                    with suppress(Exception):
                        importlib.import_module(name)
        gc.freeze()


@dataclass(frozen=True)
class _Clean:
    after: State
    calls: dict[str, int]


def _numbers(fault: Fault, count: int) -> Iterator[int]:
    """Numbers of calls: every rename, else 1, 2, 4, … and the last."""
    if fault.call == "rename":
        yield from range(1, count + 1)
        return
    n = 1
    while n < count:
        yield n
        n *= 2
    if count:
        yield count


def _be_the_command(words: tuple[str, ...], place: Path, printed: Path, plan: Plan, modules: Path) -> None:
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
        try:
            cli.main(list(words))
            code = 0
        except SystemExit as end:
            code = end.code if isinstance(end.code, int) else int(end.code is not None)
        atexit._run_exitfuncs()
        sys.stdout.flush()
        modules.write_text("\n".join(_importable()))
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


def _state(folder: Path) -> State:
    found = {}
    for path in folder.rglob("*"):
        name = path.relative_to(folder).as_posix()
        if KEPT.match(name):
            continue
        if path.is_file() and not name.endswith(JOURNALS):
            found[name] = hashlib.sha256(path.read_bytes()).hexdigest()
        elif path.is_dir() and not any(path.iterdir()):
            found[name] = "empty folder"
    return found


def _without(state: State, varying: set[str]) -> State:
    """The same, where of files that differ from run to run only the names count, and none is empty."""
    nothing = hashlib.sha256(b"").hexdigest()
    return {name: "any" if name in varying and digest != nothing else digest for name, digest in state.items()}


def _without_hidden(state: State) -> State:
    """The same without what the next process removes."""
    return {name: digest for name, digest in state.items() if not HIDDEN.search(name)}


def _faults_of(end: End, fault: Fault) -> Iterator[tuple[str, str]]:
    if end.hangs:
        yield "hang", "does not end"
    if "Traceback (most recent call last)" in end.errors:
        yield "traceback", _last_line(end.errors)
    elif "an error of quadcosim itself" in end.errors:
        yield "words", _last_line(end.errors)
    elif end.code != 0 and fault.how != KILL:
        lines = [line for line in end.errors.splitlines() if line.startswith("quadcosim: ")]
        if len(lines) != 1:
            yield "words", f"code {end.code}, {len(lines)} lines: {_last_line(end.errors)}"


def _lost(then: State, before: State, after: State, varying: set[str], *, killed: bool) -> list[tuple[str, str]]:
    """What is neither as before nor as it was to become; where a process was killed, some files may be new already."""
    if then == before:
        return []
    found = _without(then, varying)
    wrong = [name for name in {**before, **found} if found.get(name) not in (before.get(name), after.get(name))]
    if wrong:
        return [("lost", f"{min(wrong)} is neither old nor new")]
    if not killed:
        return [("lost", f"some are old, some new: {_difference(found, after)}")]
    return []


def _difference(one: State, other: State) -> str:
    names = sorted(name for name in {*one, *other} if one.get(name) != other.get(name))
    return f"{len(names)} files differ, as {names[0]}" if names else "the same files"


def _last_line(text: str) -> str:
    return (text.strip().splitlines() or [""])[-1][:200]


def work_through(
    commands: Iterable[Command], folder: Path, *, faults: Iterable[Fault] = FAULTS, most: int = 10**9,
    tell: Callable[[Row], None] = lambda row: None,
) -> list[Row]:  # fmt: skip
    """The cases of some commands; `tell` is called after each."""
    matrix = Matrix(folder)
    rows = []
    for command in commands:
        for row in matrix.rows(command, tuple(faults), most):
            rows.append(row)
            tell(row)
    return rows
