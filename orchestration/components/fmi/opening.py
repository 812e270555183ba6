"""Opens instances of FMUs: in this process, or in a separate one if a process cannot have two of them.

A reset of many FMUs is incomplete, and some share state between instances. Only what has been shown to repeat to the
bit is relied upon. It is tested once for the content of an FMU on a machine, in a confined process, and the result is
kept in the user's cache directory.
"""

import contextlib
import hashlib
import json
import platform
import sys
from dataclasses import asdict, dataclass
from pathlib import Path

from fmu_kit.new_files import write_atomically
from fmu_kit.scratch import temporary_folder
from orchestration.components.fmi.access import USUAL, Access
from orchestration.components.fmi.fmi2 import Fmi2Instance
from orchestration.components.fmi.fmi3 import Fmi3Instance
from orchestration.components.fmi.instance import Instance
from orchestration.components.fmi.native_instance import NativeInstance
from orchestration.components.fmi.read_description import read_model
from orchestration.components.fmi.trust import content_hash
from orchestration.foundation.basics.errors import QuadcosimError
from orchestration.foundation.processes import subprocesses
from orchestration.foundation.processes.resource_limits import Limits

_RULES = "2"
"""The version of the test; another one repeats all tests"""
MANNERS = ("moving", "held", "fine")
"""Kinds of the compared run, tried until one works: inputs that vary; inputs that keep their start values; a short
step"""


@dataclass(frozen=True, kw_only=True)
class Repeatability:
    """The properties of an FMU that have been shown."""

    reset: bool = False
    """A run after a reset equals that of a fresh process"""
    second_instance: bool = False
    """A run of a further instance in a process, beside another one or after it, equals that of a fresh process"""


def repeatability_of(path: Path, access: Access = USUAL) -> Repeatability:
    """The repeatability of the FMU at `path`, tested now if it has not been; raises `UsageError` if it is no FMU."""
    return _of(content_and(access, path), path, access)


def content_and(access: Access, path: Path) -> str:
    """What is known of FMUs is known by this text."""
    return content_hash(path) + ("" if access == USUAL else f" {access}")


_known: dict[str, Repeatability] = {}


def _of(content: str, path: Path, access: Access) -> Repeatability:
    if content not in _known:
        _known[content] = _stored(content) or _tested(content, path, access)
    return _known[content]


def _place(content: str) -> Path:
    import platformdirs

    where = "\n".join((_RULES, content, platform.node(), platform.platform(), sys.version))
    key = hashlib.sha256(where.encode()).hexdigest()
    return Path(platformdirs.user_cache_dir("quadcosim")) / "repeatability" / f"{key}.json"


def _stored(content: str) -> Repeatability | None:
    try:
        stored = json.loads(_place(content).read_text(encoding="utf-8"))
        return Repeatability(reset=stored["reset"] is True, second_instance=stored["second_instance"] is True)
    except (OSError, ValueError, LookupError, TypeError):
        return None


def _tested(content: str, path: Path, access: Access) -> Repeatability:
    """Test the FMU in a process; the result is kept unless the process was stopped, which may have other reasons."""
    from orchestration.foundation.processes.child import Child

    read_model(path, access)
    result = Repeatability()
    for manner in MANNERS:
        shown: dict[str, bool] = {}
        with temporary_folder() as folder:
            module = subprocesses.Module.of(
                "orchestration.components.fmi.repeatability_process", path.absolute(), manner, str(access)
            )
            with Child(module, environment=subprocesses.environment(TMPDIR=str(folder)), limits=Limits()) as child:
                ending = child.receive_all(shown.update, dict[str, bool])
        if ending.reached is not None:
            return Repeatability()
        if shown.pop("fresh", False):
            result = Repeatability(**shown)
            break
    with contextlib.suppress(OSError):  # where nothing can be written, each process repeats the test
        write_atomically(_place(content), json.dumps(asdict(result)))
    return result


_opened: set[str] = set()
"""Hashes of the FMUs that have had an instance in this process"""


def open_instance(path: Path, instance_name: str, access: Access = USUAL) -> Instance:
    """An instance of the FMU at `path`, of FMI 1.0, 2.0 or 3.0, that behaves as the first one of a process.

    A second one has a separate process if the FMU declares that a process can have one only, or if it has not been
    shown to behave as the first.
    """
    content = content_and(access, path)
    if content in _opened and not repeatability_of(path, access).second_instance:
        from orchestration.components.fmi.isolated_instance import (
            IsolatedInstance,  # not before: loads what starts processes
        )

        return IsolatedInstance(path, instance_name, access)
    _opened.add(content)
    return open_here(path, instance_name, access)


def open_here(path: Path, instance_name: str, access: Access = USUAL) -> NativeInstance:
    """An instance in this process in any case."""
    model = read_model(path, access)
    if not model.is_own:  # it may limit the size of files, and half a file of bytecode would be kept
        sys.dont_write_bytecode = True
    if model.interface != "co-simulation":
        from orchestration.components.fmi.adapted import adapted  # not before: few FMUs are called so

        try:
            return adapted(model)(path, instance_name, access)
        except QuadcosimError as error:
            if model.interface != "event-mode" or model.ticking:
                raise
            instance = Fmi3Instance(path, instance_name)
            instance.warnings.append(f"{instance_name}: handles its events itself, as it refuses event mode: {error}")
            return instance
    if model.version == 1:
        from orchestration.components.fmi.fmi1 import Fmi1Instance  # not before: few FMUs are of FMI 1.0

        return Fmi1Instance(path, instance_name, access)
    kind = Fmi3Instance if model.version == 3 else Fmi2Instance
    return kind(path, instance_name, access)
