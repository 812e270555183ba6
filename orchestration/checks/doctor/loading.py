"""Reading an FMU and loading it for real, in a confined process: one that cannot be loaded may well take its host down.

`python -m orchestration.checks.doctor.loading FMU FOLDER MB` does what the process does: the FMU is unpacked in the
folder, an empty one, and what came of it is written to it.
"""

import json
import sys
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from pydantic import TypeAdapter, ValidationError

from orchestration.basics.errors import QuadcosimError, UsageError
from orchestration.checks.doctor.fmu import CO_SIMULATION, Fmu, read_fmu
from orchestration.fmi.archive import OtherVersionError, UnreadableFmuError
from orchestration.processes import confined, subprocesses
from orchestration.processes.confined import Ending, Limits, restrict

_READ, _LOADED = "read", "loaded"
"""Files in the folder: the FMU as it was read, or an error; whether it was loaded"""
_MOST_BYTES = 50_000_000
_FMU = TypeAdapter(Fmu)
_MODEL_EXCHANGE = "not tried: it is for model exchange only"


@dataclass(frozen=True, kw_only=True)
class Trial:
    """What came of an FMU in a process of its own."""

    fmu: Fmu
    failure: str | None
    """Why it did not load; None if it did"""


def attempt(path: Path, limits: Limits) -> Trial:
    """Read, load and initialise an FMU in this Python.

    Raises `UsageError` if it is none, `OtherVersionError` if it is not of FMI 2.0.

    Where variables of the environment may mislead Python, it is tried without them first.
    """
    trial = _attempt(path, limits, subprocesses.undisturbed_environment())
    misleading = subprocesses.misleading_variables()
    if trial.failure is not None or not misleading:
        return trial
    try:
        failure = _attempt(path, limits, subprocesses.environment()).failure
    except UsageError as error:  # it can be read, as was seen before
        failure = str(error).removeprefix(f"{path}: ")
    if failure is None:
        return trial
    given = " ".join(f"{name}={value}" for name, value in misleading.items())
    return Trial(fmu=trial.fmu, failure=f"loads without {given}, not with it: {failure}")


def _attempt(path: Path, limits: Limits, environment: Mapping[str, str]) -> Trial:
    with tempfile.TemporaryDirectory(prefix="quadcosim-", ignore_cleanup_errors=True) as folder:
        command = subprocesses.command("orchestration.checks.doctor.loading", path.resolve(), folder, limits.size)
        ending = confined.run(command, environment, limits)
        read, loaded = (_content(Path(folder, name)) for name in (_READ, _LOADED))
    fmu = _read(path, read, ending)
    return Trial(fmu=fmu, failure=_failure(loaded, ending) if CO_SIMULATION in fmu.kinds else _MODEL_EXCHANGE)


def _content(path: Path) -> dict[str, object]:
    try:
        with path.open("rb") as stream:
            content = json.loads(stream.read(_MOST_BYTES))
    except (OSError, ValueError):
        return {}
    return content if isinstance(content, dict) else {}


def _read(path: Path, content: dict[str, object], ending: Ending) -> Fmu:
    if "other version" in content:
        raise OtherVersionError(str(content["other version"]))
    if "error" in content:
        raise UsageError(f"{path}: {content['error']}")
    try:
        return _FMU.validate_python(content.get("fmu"))
    except ValidationError:
        words = f": {ending.said}" if ending.said else ""
        raise UsageError(f"{path}: could not be read, the process {ending.described}{words}") from None


def _failure(loaded: dict[str, object], ending: Ending) -> str | None:
    """Why the FMU did not load; None if it did, and its process lived to its end."""
    if "failure" in loaded:
        return str(loaded["failure"])
    if ending.code is None:
        return f"its process {ending.described}"
    return None if loaded and ending.code == 0 else f"took its process down: it {ending.described}"


def main(path: Path, folder: Path, size_limit: float) -> None:
    """Read, unpack, instantiate, initialise and free the FMU."""
    restrict(size_limit)
    try:
        fmu = read_fmu(path, size_limit)
    except OtherVersionError as error:
        _write(folder / _READ, **{"other version": str(error)})
        return
    except UnreadableFmuError as error:
        _write(folder / _READ, error=str(error))
        return
    _write(folder / _READ, fmu=json.loads(_FMU.dump_json(fmu)))
    if CO_SIMULATION in fmu.kinds:
        try:
            _load(fmu, folder / "fmu")
        except (QuadcosimError, OSError) as error:
            _write(folder / _LOADED, failure=" ".join(str(error).split()))
        else:
            _write(folder / _LOADED, loads=True)


def _load(fmu: Fmu, folder: Path) -> None:
    """With what its description must say and no more: it may be odd in what loading does not need."""
    import fmpy
    from fmpy import fmi2

    from orchestration.fmi.messages import Message, collecting_callbacks, words
    from orchestration.fmi.pythonfmu import expect_readable_place, release_interpreter_state

    if fmpy.platform not in fmpy.supported_platforms(str(fmu.path)):
        raise QuadcosimError(f"has no binary for {fmpy.platform}")
    fmpy.extract(str(fmu.path), str(folder))
    expect_readable_place(folder)
    messages: list[Message] = []
    call = "loading"
    try:
        slave = fmi2.FMU2Slave(
            guid=fmu.guid, unzipDirectory=str(folder), modelIdentifier=fmu.model_identifier, instanceName="doctor"
        )
        call = "fmi2Instantiate"
        slave.instantiate(callbacks=collecting_callbacks(messages, "doctor", folder), loggingOn=True)
        release_interpreter_state(slave.dll)
        call = "fmi2SetupExperiment"
        slave.setupExperiment(startTime=fmu.start_time)
        call = "fmi2EnterInitializationMode"
        slave.enterInitializationMode()
        call = "fmi2ExitInitializationMode"
        slave.exitInitializationMode()
    except Exception as error:
        raise QuadcosimError(f"{call}: {words(messages, str(error))[0]}") from error
    slave.freeInstance()


def _write(path: Path, **content: object) -> None:
    path.write_text(json.dumps(content), encoding="utf-8")


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]), float(sys.argv[3]))
