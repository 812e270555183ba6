"""Whether a run of an FMU is the same again: after a reset, and in a second instance of the process.

Many FMUs do not come back from a reset as they were, some keep what they learnt from one instance to the next. What
is not shown to be the same, to the bit, is not relied upon. It is shown once for the content of an FMU on a machine,
in a confined process, and kept in the user's cache directory.
"""

import functools
import hashlib
import json
import os
import platform
import sys
import tempfile
from dataclasses import asdict, dataclass
from pathlib import Path

from orchestration.fmi.model import read_model
from orchestration.processes import subprocesses
from orchestration.processes.child import Child
from orchestration.processes.limits import Limits

_RULES = "2"
"""Of how it is shown; another number shows all anew"""
MANNERS = ("moving", "held", "fine")
"""Of the run that is compared, until one of them works: inputs that move; that keep their start values; with a short
step"""


@dataclass(frozen=True, kw_only=True)
class Repeatability:
    """What has been shown of an FMU."""

    reset: bool = False
    """A run after a reset is the run of a fresh process"""
    second_instance: bool = False
    """A run of a further instance in a process, beside another one or after it, is the run of a fresh process"""


def of(path: Path) -> Repeatability:
    """What is shown of the FMU at `path`, now if it has not been before; raises `UsageError` for no FMU."""
    return _of(content_hash(path), path)


def content_hash(path: Path) -> str:
    """SHA-256 of a file, read again only if it has changed."""
    status = path.stat()
    return _hash(path.absolute(), status.st_mtime_ns, status.st_size)


@functools.lru_cache(maxsize=256)
def _hash(path: Path, changed: int, size: int) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


_known: dict[str, Repeatability] = {}


def _of(content: str, path: Path) -> Repeatability:
    if content not in _known:
        _known[content] = _stored(content) or _shown(content, path)
    return _known[content]


def _place(content: str) -> Path:
    import platformdirs

    where = "\n".join((_RULES, content, platform.node(), platform.platform(), sys.version))
    key = hashlib.sha256(where.encode()).hexdigest()
    return Path(platformdirs.user_cache_dir("quadcosim")) / "repeatability" / f"{key}.json"


def _stored(content: str) -> Repeatability | None:
    try:
        found = json.loads(_place(content).read_text(encoding="utf-8"))
        return Repeatability(reset=found["reset"] is True, second_instance=found["second_instance"] is True)
    except (OSError, ValueError, LookupError, TypeError):
        return None


def _shown(content: str, path: Path) -> Repeatability:
    """By a process that runs the FMU; kept unless the process was stopped, which may have had other reasons."""
    read_model(path)
    found = Repeatability()
    for manner in MANNERS:
        shown: dict[str, bool] = {}
        with tempfile.TemporaryDirectory(prefix="quadcosim-", ignore_cleanup_errors=True) as folder:
            command = subprocesses.command("orchestration.fmi.repeatability_process", path.absolute(), manner)
            with Child(command, environment=subprocesses.environment(TMPDIR=folder), limits=Limits()) as child:
                ending = child.receive_all(shown.update)
        if ending.reached is not None:
            return Repeatability()
        if shown.pop("fresh", False):
            found = Repeatability(**shown)
            break
    _keep(_place(content), found)
    return found


def _keep(path: Path, found: Repeatability) -> None:
    """For the processes to come; where nothing can be written, each shows it anew."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        fresh = path.with_name(f"{path.name}.{os.getpid()}")
        fresh.write_text(json.dumps(asdict(found)), encoding="utf-8")
        fresh.replace(path)
    except OSError:
        pass
