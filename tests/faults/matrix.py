"""Commands at each of whose calls of the operating system something fails: what becomes of their files.

Each case is a command in a folder of its own, and then the command once more without a fault, unless the folder is in a
state from which it has been run before.
"""

import re
import shutil
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

from tests.faults import forked
from tests.faults.commands import BEFORE, RUN, TEXTS, Command
from tests.faults.contents import (
    EMPTY,
    HIDDEN,
    STORE,
    Contents,
    as_bytes,
    contents,
    difference,
    finished,
    rows,
    without_hidden,
    without_varying,
)
from tests.faults.forked import End
from tests.faults.shim import FAULTS, KILL, KILLED, Fault, Plan

OLD = b"years of work"
EACH = 16
"""Up to which each request of memory fails"""

Finding = tuple[str, str]
"""A kind of outcome that must not be, and what is wrong"""


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
class Clean:
    """A command without a fault."""

    after: Contents
    varying: set[str]
    """Files that differ from run to run"""
    calls: dict[str, int]

    def is_reached(self, found: Contents) -> bool:
        """Whether all has been done."""
        return without_varying(found, self.varying) == self.after


class Matrix:
    """Cases of commands, in a temporary folder."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.plan = Plan(folder / "plan")
        self._before: dict[str, Path] = {}
        self._again: dict[tuple[str, frozenset[tuple[str, str]]], list[Finding]] = {}
        self._count = 0

    def rows(self, command: Command, faults: Iterable[Fault] = FAULTS, most: int = 10**9) -> Iterator[Row]:
        """All cases of a command, with at most `most` numbers of a kind of call, but all renames."""
        clean = self.clean(command)
        for fault in faults:
            chosen = list(numbers(fault, clean.calls[fault.call]))
            for n in chosen if fault.call == "rename" else chosen[:most]:
                place = self._place(command)
                row = self._case(command, fault, n, clean, place)
                shutil.rmtree(place)
                if row is not None:
                    yield row

    def clean(self, command: Command) -> Clean:
        """The command without a fault, twice."""
        found = []
        for _ in range(2):
            place = self._place(command)
            end = self._run(command.words, place)
            if end.code != 0 or end.hangs:
                raise RuntimeError(f"{command.name} without a fault: code {end.code}: {end.errors}")
            calls = self.plan.calls()
            forked.know_modules(self.plan)
            found.append(contents(place / "work"))
            shutil.rmtree(place)
        one, other = found
        varying = {name for name in one if one[name] != other.get(name)}
        return Clean(without_varying(one, varying), varying, calls)

    def _case(self, command: Command, fault: Fault, n: int, clean: Clean, place: Path) -> Row | None:
        before = contents(place / "work")
        end = self._run(command.words, place, fault, n)
        if not self.plan.struck:
            return None
        killed, then = fault.how == KILL, contents(place / "work")
        then, beside = _parted(without_hidden(finished(then) if killed else then), command)
        is_new = clean.is_reached(then)
        found = [*_of_end(end, killed=killed), *_of_runs_beside(beside, end, clean, killed=killed)]
        if end.code == 0 and not is_new and not killed:
            found.append(("silent", f"code 0, but {difference(without_varying(then, clean.varying), clean.after)}"))
        elif not is_new:
            if command.resumes:  # all that it makes is in one folder
                then = {name: digest for name, digest in then.items() if digest != EMPTY}
            found += _lost(then, before, clean, some=killed or command.resumes)
        found += self._next(command, place, clean, is_new=is_new)
        outcome = found[0][0] if found else "new" if is_new else "old"
        return Row(command.name, f"{fault.call}: {fault.text}", n, outcome, "; ".join(note for _, note in found))

    def _next(self, command: Command, place: Path, clean: Clean, *, is_new: bool) -> list[Finding]:
        """What is wrong with the command once more, without a fault, where a case has left off."""
        state = as_bytes(place)
        if is_new:
            state = without_varying(state, {f"work/{name}" for name in clean.varying})
        key = (command.name, frozenset(state.items()))
        if key not in self._again:
            self._again[key] = list(self._again_without_fault(command, place, clean))
        return self._again[key]

    def _again_without_fault(self, command: Command, place: Path, clean: Clean) -> Iterator[Finding]:
        done = {path: set(rows(path, whole=True)) for path in (place / "work").rglob(f"*{STORE}")}
        end = self._run(command.words, place)
        last = contents(place / "work")
        then, _ = _parted(without_hidden(last), command)
        if end.hangs or (end.code != 0 and not (command.once and clean.is_reached(then))):
            yield "stuck", f"then: code {end.code}: {_last_line(end.errors)}"
        elif not clean.is_reached(then):
            yield "stuck", f"then: {difference(without_varying(then, clean.varying), clean.after)}"
        for path, before in done.items():
            if command.resumes and (lost := before - set(rows(path, whole=True))):
                yield "lost", f"then: {len(lost)} rows of {path.name} were made again"
        if any((place / "tmp").iterdir()):  # the next command that needs a temporary folder removes what is there
            self._run(RUN, place)
        left = [str(path.relative_to(place)) for path in (place / "tmp").iterdir() if not _is_a_trial(path)]
        if left := left + [name for name in last if HIDDEN.search(name)]:
            yield "left", ", ".join(sorted(left)[:3])

    def _place(self, command: Command) -> Path:
        self._count += 1
        place = _new_place(self.folder / f"case{self._count}")
        work = place / "work"
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
        if name not in self._before:
            place = _new_place(self.folder / f"before-{name}")
            for file, text in TEXTS.items():
                (place / "work" / file).write_text(text, encoding="utf-8")
            before = BEFORE[name]
            end = self._run(before.words, place, KILLED if before.killed_at else None, before.killed_at)
            if (end.code != 0) != bool(before.killed_at):
                raise RuntimeError(f"{name}: {end.errors}")
            self._before[name] = place / "work" / name
        return self._before[name]

    def _run(self, words: tuple[str, ...], place: Path, fault: Fault | None = None, n: int = 0) -> End:
        self.plan.write(place, fault, n)
        return forked.run(words, place, self.plan)


def numbers(fault: Fault, count: int) -> Iterator[int]:
    """Numbers of calls: every rename and the first requests of memory, else 1, 2, 4, … and the last."""
    each = count if fault.call == "rename" else EACH if fault.call == "malloc" else 1
    n = 1
    while n < count:
        yield n
        n = n + 1 if n < each else 2 * n
    if count:
        yield count


def _is_a_trial(path: Path) -> bool:
    """Whether it is the file by which Python's `tempfile` tries a folder, in a process that was killed just then."""
    return re.fullmatch(r"[a-z0-9_]{8}", path.name) is not None and path.read_bytes() in (b"", b"blat")


def _new_place(place: Path) -> Path:
    for each in ("tmp", "work"):
        (place / each).mkdir(parents=True)
    return place


def _parted(found: Contents, command: Command) -> tuple[Contents, dict[str, Contents]]:
    """The files without runs that are beside their place, and those runs by name, as if they were at it."""
    if command.beside is None:
        return found, {}
    others: Contents = {}
    beside: dict[str, Contents] = {}
    for name, digest in found.items():
        folder = re.match(rf"({re.escape(command.beside)}\.\d+)(?=/|$)", name)
        if folder is None:
            others[name] = digest
        else:
            beside.setdefault(folder[0], {})[command.beside + name[folder.end() :]] = digest
    return others, beside


def _of_runs_beside(beside: dict[str, Contents], end: End, clean: Clean, *, killed: bool) -> Iterator[Finding]:
    """What is wrong with runs that could not take their place: each file is whole, and the line names the folder."""
    for folder, found in beside.items():
        wrong = [
            name for name, digest in without_varying(found, clean.varying).items() if clean.after.get(name) != digest
        ]
        if wrong:
            yield "lost", f"{folder}: {min(wrong)} is not whole"
        elif folder not in end.errors and not killed:
            yield "words", f"{folder} is not named: {_last_line(end.errors)}"


def _of_end(end: End, *, killed: bool) -> Iterator[Finding]:
    if end.hangs:
        yield "hang", "does not end"
    if "Traceback (most recent call last)" in end.errors:
        yield "traceback", _last_line(end.errors)
    elif "an error of quadcosim itself" in end.errors:
        yield "words", _last_line(end.errors)
    elif end.code != 0 and not killed:
        lines = [line for line in end.errors.splitlines() if line.startswith("quadcosim: ")]
        if len(lines) != 1:
            yield "words", f"code {end.code}, {len(lines)} lines: {_last_line(end.errors)}"


def _lost(then: Contents, before: Contents, clean: Clean, *, some: bool) -> Iterator[Finding]:
    """What is neither as before nor as it was to become; with `some`, some files may be new already."""
    if then == before:
        return
    found = without_varying(then, clean.varying)
    wrong = [name for name in {**before, **found} if found.get(name) not in (before.get(name), clean.after.get(name))]
    if wrong:
        yield "lost", f"{min(wrong)[:200]} is neither old nor new"
    elif not some:
        yield "lost", f"some are old, some new: {difference(found, clean.after)}"


def _last_line(text: str) -> str:
    return (text.strip().splitlines() or [""])[-1][:200]


def work_through(
    commands: Iterable[Command], folder: Path, *, faults: Iterable[Fault] = FAULTS, most: int = 10**9,
    tell: Callable[[Row], None] = lambda row: None,
) -> list[Row]:  # fmt: skip
    """The cases of some commands; `tell` is called after each."""
    matrix = Matrix(folder)
    found = []
    for command in commands:
        for row in matrix.rows(command, tuple(faults), most):
            found.append(row)
            tell(row)
    return found
