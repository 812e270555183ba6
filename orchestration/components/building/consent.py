"""Consent to building FMUs of code that is not of this project, which runs that code: modules of Python, sources in C.

A program that calls this package consents by the call. The command line asks once for each folder, whose FMUs may
then be built whenever their code has changed.
"""

import hashlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

from fmu_kit.new_files import write_atomically
from orchestration.foundation.basics.errors import UsageError
from orchestration.foundation.processes.subprocesses import checkout

Ask = Callable[[str], bool]
"""Asks the user a question; returns whether the answer is yes"""


@dataclass(kw_only=True)
class _Policy:
    ask: Ask
    allowed: bool = False


_policy: _Policy | None = None


@contextmanager
def asking(ask: Ask) -> Iterator[None]:
    """While the block runs, building asks for consent to each folder that has none."""
    global _policy
    before, _policy = _policy, _Policy(ask=ask)
    try:
        yield
    finally:
        _policy = before


def allow() -> None:
    """Consent to all folders until the end of the block of `asking`."""
    if _policy is not None:
        _policy.allowed = True


def is_allowed() -> bool:
    """Whether building needs no consent."""
    return _policy is None or _policy.allowed


def agree(folder: Path) -> None:
    """Record the consent to `folder`; where nothing can be written, it is asked for again."""
    with suppress(OSError):
        write_atomically(_place(folder), f"{folder.resolve()}\n")


def expect(fmu: Path, folder: Path) -> None:
    """Raise `UsageError` if an FMU may not be built of the code in `folder`; consent is recorded."""
    if _policy is None or is_of_this_project(folder) or _place(folder).is_file():
        return
    what = f"building it runs the code in {folder.resolve()}, which is not of this project"
    if not (_policy.allowed or _policy.ask(f"{fmu} is missing or out of date; {what}. Build it?")):
        raise UsageError(f"{fmu}: is missing or out of date; {what}: expected --build, once for this folder")
    agree(folder)


def is_of_this_project(folder: Path) -> bool:
    """Whether it is in the examples of the checkout that this package runs from."""
    root = checkout()
    return root is not None and folder.resolve().is_relative_to(root / "examples")


def _place(folder: Path) -> Path:
    import platformdirs

    key = hashlib.sha256(str(folder.resolve()).encode("utf-8", "surrogateescape")).hexdigest()
    return Path(platformdirs.user_cache_dir("quadcosim")) / "agreed" / key
