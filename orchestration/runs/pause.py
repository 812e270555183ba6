"""Stopping a run at a communication point and going on later, in another process, to the same bits."""

import hashlib
import json
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from orchestration.basics.errors import UsageError
from orchestration.engines.engine import Engine
from orchestration.processes.limits import Limits
from orchestration.recording.recording import InMemory, Recorder
from orchestration.recording.tables import InFolder, ToFolder
from orchestration.requests.request import Asked, asked_for, load_request
from orchestration.runs.meant import Announce, Progress
from orchestration.runs.result import Result
from orchestration.runs.run_directory import METRICS, SCENARIO, STATE, keep_flight
from orchestration.runs.simulation import PreparedRun, flown
from orchestration.system.files_read import files_read
from orchestration.system.request import system_meant
from orchestration.system.times import nanoseconds


def fly_until(
    asked: Asked,
    pause_at: float,
    folder: str | Path,
    *,
    figures: bool = True,
    progress: Progress | None = None,
    announce: Announce | None = None,
    engine: Engine | None = None,
    in_process: bool = False,
    time_limit: float | None = None,
    memory_limit: float = Limits.memory,
) -> Result | None:
    """Fly to the first communication point from `pause_at` [s] and write the state into `folder`, a new one.

    Returns None, or the result if the run was over before: its directory is then in `folder`. Where it is flown, and
    within which limits, is as in `run`.
    """
    request = asked_for(asked)
    stop_time = system_meant(request).stop_time
    if not 0.0 <= pause_at < stop_time:
        raise UsageError(f"pause at {pause_at:g} s: expected a time from 0 to before stop_time {stop_time:g} s")

    def fly(recorder: ToFolder) -> Result | None:
        result = flown(
            request, partial(_until, pause_at, recorder.folder.absolute()), recorder=recorder, progress=progress,
            announce=announce, engine=engine, in_process=in_process, time_limit=time_limit, memory_limit=memory_limit,
        )  # fmt: skip
        if result is None:
            recorder.finish()
        return result

    return keep_flight(folder, fly, figures=figures, replaces=())


def _until(pause_at: float, folder: Path, flight: PreparedRun, progress: Progress | None) -> bool:
    """The course of a run that is paused: its state is then in `folder`."""
    _expect_states(flight)
    flight.master.initialise()
    over = flight.master.run(pause_at=nanoseconds(pause_at), progress=progress)
    if not over:
        _write(flight, folder)
    return over


def resume(
    folder: str | Path,
    out: str | Path | None = None,
    *,
    figures: bool = True,
    progress: Progress | None = None,
    announce: Announce | None = None,
    engine: Engine | None = None,
    in_process: bool = False,
    time_limit: float | None = None,
    memory_limit: float = Limits.memory,
) -> Result:
    """Go on with the run paused in `folder`, to the end; its directory is then in `out`, which may be `folder`.

    Where it is flown, and within which limits, is as in `run`. Raises `UsageError` if there is none, or if the
    scenario, its reference or an FMU is not the one that it was paused with.
    """
    folder = Path(folder)
    if not (folder / STATE).is_file():
        raise UsageError(f"{folder}: expected the directory of a paused run; it has no {STATE}")
    asked = load_request(folder / SCENARIO)
    read_state(folder / STATE)  # what is damaged is to be known now

    def fly(recorder: Recorder) -> Result:
        result = flown(
            asked, partial(_rest, folder), recorder=recorder, progress=progress, announce=announce, engine=engine,
            in_process=in_process, time_limit=time_limit, memory_limit=memory_limit,
        )  # fmt: skip
        assert result is not None
        return result

    if out is None:
        return fly(InMemory())
    same = folder.resolve() == Path(out).resolve()
    result = keep_flight(out, fly, figures=figures, replaces=(METRICS, STATE) if same else (METRICS,))
    assert result is not None
    return result


def _rest(folder: Path, flight: PreparedRun, progress: Progress | None) -> bool:
    """The course of a run that was paused in `folder`."""
    state, saved = read_state(folder / STATE)
    _expect_same(state.pop("of"), flight, folder)
    for chunk in InFolder(folder).chunks():
        flight.recorder.take(chunk)
    flight.master.restore(state, saved)
    return flight.master.run(progress=progress)


def read_state(path: Path) -> tuple[dict[str, Any], dict[str, bytes]]:
    """What `Master.restore` needs, from the file of a paused run.

    Raises `UsageError` for any other than the one that was written.
    """
    try:
        with path.open("rb") as file, np.load(file, allow_pickle=False) as archive:
            text = str(archive["json"])
            parts = {name: archive[name].tobytes() for name in archive.files if name not in ("json", "digest")}
            whole = str(archive["digest"]) == _digest(text, parts)
    except Exception as error:  # what a damaged file raises is not documented
        raise UsageError(f"{path}: expected the state of a paused run, as it was written: {error}") from error
    if not whole:
        raise UsageError(f"{path}: expected the state of a paused run, as it was written")
    state: dict[str, Any] = json.loads(text)
    return state, parts


def _write(flight: PreparedRun, folder: Path) -> None:
    state, parts = flight.master.state(), flight.master.saved()
    text = json.dumps({**state, "of": _hashes(flight)})
    arrays = {name: np.frombuffer(part, dtype=np.uint8) for name, part in parts.items()}
    (folder / SCENARIO).write_text(flight.asked.to_toml(), encoding="utf-8")
    strings = {"json": np.array(text), "digest": np.array(_digest(text, parts))}
    np.savez(folder / STATE, allow_pickle=False, **strings, **arrays)


def _digest(text: str, parts: dict[str, bytes]) -> str:
    """Of all that a state is made of, so that only what was written is restored."""
    content = hashlib.sha256(text.encode())
    for name in sorted(parts):
        content.update(hashlib.sha256(parts[name]).digest())
    return content.hexdigest()


def _hashes(flight: PreparedRun) -> dict[str, str]:
    """Of everything that a run goes on from beside its state."""
    return {
        SCENARIO: hashlib.sha256(flight.asked.to_toml().encode()).hexdigest(),
        **{f"the file of {name}": _hash(path) for name, path in files_read(flight.system).items()},
        **{f"the FMU of {name}": _hash(instance.path) for name, instance in flight.instances.items()},
    }


def _expect_states(flight: PreparedRun) -> None:
    """Raise `UsageError` naming components whose state cannot be saved."""
    without = [name for name, instance in flight.instances.items() if not instance.model.saves_state]
    if without:
        raise UsageError(f"pause: the FMU of {', '.join(without)} cannot save its state; expected FMUs that can")


def _hash(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


def _expect_same(paused: dict[str, str], flight: PreparedRun, folder: Path) -> None:
    for what, found in _hashes(flight).items():
        if found != paused.get(what):
            raise UsageError(f"{folder}: {what} is not as when the run was paused; expected it unchanged")
