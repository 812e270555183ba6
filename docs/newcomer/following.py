"""Follows a page block by block, and raises `BlockFailed` where one does not work."""

import json
import os
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import IO

from docs.newcomer.blocks import OUTPUT, Block

TIMEOUT = 1800.0
"""Time limit of a line [s]"""
SHOWN = 3000
"""Number of characters shown of the output of a failed block"""
KEPT = ("HOME", "LANG", "TMPDIR", "http_proxy", "https_proxy", "no_proxy", "PIP_INDEX_URL", "PIP_CONFIG_FILE")
"""Environment variables that are passed on: without them nothing can be installed"""

Report = Callable[[str], None]


class BlockFailed(Exception):
    """A block does not do what the page says."""


@dataclass(frozen=True, kw_only=True)
class Skipped:
    """A part that was not run, or not as written, and the reason."""

    place: str
    what: str
    reason: str


class Newcomer:
    """Follows pages in `folder`, a copy of the repository and nothing else; `report` receives a line for each step."""

    def __init__(self, folder: Path, report: Report) -> None:
        self._folder, self._report = folder, report
        self._here = folder
        self._printed = ""
        self._python: _Python | None = None
        self.skipped: list[Skipped] = []
        self.done = 0
        """number of blocks that worked"""

    @property
    def environment(self) -> dict[str, str]:
        """The environment of the processes, with that of the page's `.venv`."""
        own = self._folder / ".venv" / "bin"
        inherited = {name: os.environ[name] for name in KEPT if name in os.environ}
        return {**inherited, "PATH": f"{own}:/usr/local/bin:/usr/bin:/bin", "MPLBACKEND": "Agg", "COLUMNS": "120"}

    def _own(self, program: str) -> str:
        """The path of a program in the environment that the pages set up."""
        return str(self._folder / ".venv" / "bin" / program)

    def start_page(self) -> None:
        """Begin a page, in the top folder and without an open Python session."""
        self._here = self._folder
        self.close()

    def close(self) -> None:
        """Close the Python session, if open."""
        if self._python is not None:
            self._python.close()
            self._python = None

    def follow(self, block: Block) -> None:
        """Follow one block; raises `BlockFailed`."""
        if block.skipped is not None:
            self.skipped.append(Skipped(place=block.place, what="the block", reason=block.skipped))
            return
        if block.name and block.name != OUTPUT:
            (self._here / block.name).write_text(block.text, encoding="utf-8")
        if block.is_shell:
            for line in [f"bash {block.name}"] if block.name else block.lines:
                self._line(block, line)
        elif block.language in ("python", "py"):
            self._run_python(block)
        elif block.language == "toml":
            self._read(block)
        elif block.name == OUTPUT:
            self._expect_printed(block)
        elif not block.name and not block.is_shown:
            raise BlockFailed(f"{block.place}: expected a name for the file, or a comment that says why it is not run")
        self.done += 1

    def _line(self, block: Block, line: str) -> None:
        note = block.note_on(line)
        if note is not None:
            self.skipped.append(Skipped(place=block.place, what=note.command or line, reason=note.reason))
            if note.instead is None:
                return
            line = note.instead
        where = self._folder / ".newcomer"
        began = time.monotonic()
        done = subprocess.run(
            ["bash", "-c", f'{line}\nended=$?; pwd > "{where}"; exit $ended'], cwd=self._here, env=self.environment,
            stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, encoding="utf-8",
            errors="replace", timeout=TIMEOUT, check=False,
        )  # fmt: skip
        self._report(f"{block.place}: {line}  [{time.monotonic() - began:.1f} s]")
        self._printed = done.stdout
        if done.returncode != 0:
            raise BlockFailed(f"{block.place}: {line}\nended with {done.returncode}:\n{done.stdout[-SHOWN:]}")
        self._here = Path(where.read_text(encoding="utf-8").strip())
        where.unlink()

    def _run_python(self, block: Block) -> None:
        began = time.monotonic()
        if block.name:
            done = subprocess.run(
                [self._own("python"), block.name], cwd=self._here, env=self.environment, capture_output=True, text=True,
                check=False,
            )  # fmt: skip
            failure, self._printed = done.stdout + done.stderr if done.returncode else None, done.stdout
        else:
            self._python = self._python or _Python(self._own("python"), self._here, self.environment)
            failure = self._python.run(block.text)
        self._report(f"{block.place}: {block.name or 'Python'}  [{time.monotonic() - began:.1f} s]")
        if failure is not None:
            raise BlockFailed(f"{block.place}: {block.name or 'Python'}\n{failure[-SHOWN:]}")

    def _read(self, block: Block) -> None:
        path = self._here / (block.name or "block.toml")
        path.write_text(block.text, encoding="utf-8")
        command = [self._own("python"), "-m", "docs.newcomer.readers", str(path)]
        done = subprocess.run(
            command, cwd=self._folder, env=self.environment, capture_output=True, text=True, check=False
        )  # fmt: skip
        self._report(f"{block.place}: TOML, {done.stdout.strip()}")
        if done.returncode != 0:
            raise BlockFailed(f"{block.place}: cannot be read:\n{done.stderr[-SHOWN:]}")
        if not block.name:
            path.unlink()

    def _expect_printed(self, block: Block) -> None:
        for line in map(str.strip, block.text.splitlines()):
            if not all(part in self._printed for part in line.split("…")):
                raise BlockFailed(
                    f"{block.place}: expected the output before it to have {line}:\n{self._printed[-SHOWN:]}"
                )


class _Python:
    """A Python session that stays open."""

    def __init__(self, python: str, folder: Path, environment: dict[str, str]) -> None:
        reading, writing = os.pipe()
        session = Path(__file__).with_name("session.py")
        self._process = subprocess.Popen(
            [python, str(session), str(writing)], cwd=folder, env=environment,
            stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, stderr=subprocess.STDOUT, text=True, pass_fds=[writing],
        )  # fmt: skip
        os.close(writing)
        self._answers: IO[str] = os.fdopen(reading)

    def run(self, code: str) -> str | None:
        """Run code; returns the traceback, or None if there was none."""
        assert self._process.stdin is not None
        self._process.stdin.write(json.dumps(code) + "\n")
        self._process.stdin.flush()
        answer = self._answers.readline()
        failure: str | None = json.loads(answer) if answer else "Python ended"
        return failure

    def close(self) -> None:
        """End the session."""
        assert self._process.stdin is not None
        self._process.stdin.close()
        self._process.wait()
        self._answers.close()


def print_now(text: str) -> None:
    """Print a line on standard output, without buffering."""
    print(text, flush=True)
    sys.stdout.flush()
