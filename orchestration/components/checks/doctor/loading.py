"""Reads and loads an FMU in a confined process, as one that cannot be loaded may crash its host.

`python -m orchestration.components.checks.doctor.loading FMU FOLDER MB` is that process: it unpacks the FMU in the
folder, an empty one, and sends an `error`, or the `fmu` and whether it `loads`, or the `failure`.
"""

import importlib
import sys
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from fmu_kit.scratch import temporary_folder
from orchestration.components.checks.doctor.fmu import CALLED, KINDS, InspectedFmu, inspected
from orchestration.components.fmi.archive import OtherVersionError, UnreadableFmuError
from orchestration.foundation.basics.errors import QuadcosimError, UsageError
from orchestration.foundation.processes import subprocesses
from orchestration.foundation.processes.channel import Parent
from orchestration.foundation.processes.child import Child, Ending
from orchestration.foundation.processes.resource_limits import Limits, restrict

_Report = dict[str, InspectedFmu | UnreadableFmuError | str | bool]
"""Parts of what the process sends"""


@dataclass(frozen=True, kw_only=True)
class Trial:
    """The result of trying an FMU in a separate process."""

    fmu: InspectedFmu
    failure: str | None
    """why it did not load; None if it did"""


def try_loading(path: Path, limits: Limits) -> Trial:
    """Read, load and initialise an FMU in this Python.

    Raises `UsageError` if it is none, `OtherVersionError` if it is of another version than FMI 2.0 and 3.0.

    If environment variables may mislead Python, it is tried without them first.
    """
    trial = _try_loading(path, limits, subprocesses.undisturbed_environment())
    misleading = subprocesses.misleading_variables()
    if trial.failure is not None or not misleading:
        return trial
    try:
        failure = _try_loading(path, limits, subprocesses.environment()).failure
    except UsageError as error:  # it was readable before
        failure = str(error).removeprefix(f"{path}: ")
    if failure is None:
        return trial
    settings = " ".join(f"{name}={value}" for name, value in misleading.items())
    return Trial(fmu=trial.fmu, failure=f"loads without {settings}, not with it: {failure}")


def _try_loading(path: Path, limits: Limits, environment: Mapping[str, str]) -> Trial:
    with temporary_folder() as folder:
        module = subprocesses.Module.of(
            "orchestration.components.checks.doctor.loading", path.resolve(), folder, limits.size
        )
        received: dict[str, Any] = {}
        with Child(module, environment=environment, limits=limits) as child:
            ending = child.receive_all(received.update, _Report)
    if isinstance(received.get("error"), OtherVersionError):
        raise received["error"]
    if "error" in received:
        raise UsageError(f"{path}: {received['error']}")
    fmu = received.get("fmu")
    if not isinstance(fmu, InspectedFmu):
        words = f": {ending.last_line}" if ending.last_line else ""
        raise UsageError(f"{path}: could not be read, the process {ending.description}{words}")
    if fmu.kinds[0] not in CALLED:
        return Trial(fmu=fmu, failure=f"not tried: it is for {KINDS[fmu.kinds[0]]} only")
    return Trial(fmu=fmu, failure=_failure(received, ending))


def _failure(received: dict[str, Any], ending: Ending) -> str | None:
    """Why the FMU did not load; None if it did, and its process reached its end."""
    if "failure" in received:
        return str(received["failure"])
    if ending.code is None:
        return f"its process {ending.description}"
    return None if "loads" in received and ending.code == 0 else f"took its process down: it {ending.description}"


def main(path: str, folder: str, size: str) -> None:
    """Read, unpack, instantiate, initialise and free the FMU."""
    _try(Path(path), Path(folder), float(size), Parent().send)


def _try(path: Path, folder: Path, size_limit: float, send: Callable[[object], None]) -> None:
    restrict(size_limit)
    importlib.import_module("pydantic")  # as commands that report what is wrong: it may be that of another Python
    try:
        fmu = inspected(path, size_limit)
    except UnreadableFmuError as error:
        send({"error": error})
        return
    send({"fmu": fmu})
    if fmu.kinds[0] in CALLED:
        try:
            _load(fmu, folder)
        except (QuadcosimError, OSError) as error:
            send({"failure": " ".join(str(error).split())})
        else:
            send({"loads": True})


def _load(fmu: InspectedFmu, folder: Path) -> None:
    """Load with the required parts of the description only: others may be invalid."""
    import fmpy

    from orchestration.components.fmi.slaves import (
        Message,
        expect_readable_place,
        failure_text,
        folder_here,
        instantiate,
        instantiates,
        load_slave,
    )

    folder_here(fmu.version, [part.platform for part in fmu.platforms])
    fmpy.extract(str(fmu.path), str(folder))
    expect_readable_place(folder)
    messages: list[Message] = []
    call = "loading"
    try:
        interface = CALLED[fmu.kinds[0]]
        slave = load_slave(
            fmu.version, folder, token=fmu.guid, identifier=fmu.model_identifier, name="doctor", interface=interface
        )
        call = instantiates(fmu.version, interface)
        instantiate(slave, messages, interface)
        for call, make in _initialisation(slave, fmu):  # noqa: B007 - the last one is named where it fails
            make()
    except Exception as error:
        raise QuadcosimError(f"{call}: {failure_text(messages, str(error))[0]}") from error
    slave.freeInstance()


def _initialisation(slave: Any, fmu: InspectedFmu) -> Iterator[tuple[str, Callable[[], object]]]:
    """The calls that initialise an instance, by the names of their functions."""
    enter, start = slave.enterInitializationMode, fmu.start_time
    if fmu.version == 2:
        yield "fmi2SetupExperiment", lambda: slave.setupExperiment(startTime=start)
        yield "fmi2EnterInitializationMode", enter
    else:
        yield "fmi3EnterInitializationMode", lambda: enter(startTime=start)
    yield f"fmi{fmu.version}ExitInitializationMode", slave.exitInitializationMode


if __name__ == "__main__":
    main(*sys.argv[1:])
