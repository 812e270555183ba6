"""Pausing a run at a communication point and resuming it, in another process if need be, with the same bits."""

import hashlib
import json
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from fmu_kit.new_files import clear, new_file, write_atomically
from orchestration.components.fmi.instance import NO_STATE
from orchestration.components.fmi.trust import content_hash
from orchestration.foundation.basics.errors import UsageError, told_apart
from orchestration.foundation.basics.times import nanoseconds
from orchestration.foundation.processes.resource_limits import Limits
from orchestration.foundation.recording.recording import InMemory, Recorder
from orchestration.foundation.recording.tables import InFolder, ToFolder
from orchestration.simulation.engines.master import Engine
from orchestration.simulation.engines.resolved import Announce
from orchestration.simulation.requests.request import RequestLike, load_request, request_of
from orchestration.simulation.runs.outcome import Progress
from orchestration.simulation.runs.prepared import PreparedRun
from orchestration.simulation.runs.result import Result
from orchestration.simulation.runs.run_directory import METRICS, SCENARIO, STATE, keep_run
from orchestration.simulation.runs.simulation import simulate
from orchestration.systems.system.files import input_files
from orchestration.systems.system.request import system_of


def fly_until(
    request: RequestLike,
    pause_at: float,
    out: str | Path,
    *,
    figures: bool = True,
    progress: Progress | None = None,
    announce: Announce | None = None,
    engine: Engine | None = None,
    in_process: bool = False,
    time_limit: float | None = None,
    memory_limit: float = Limits.memory,
    pace: float | None = None,
) -> Result | None:
    """Run to the first communication point from `pause_at` [s] on, and write the state into `out`, a new folder.

    Returns None, or the result if the run ended before: its directory is then in `out`. All other arguments are
    those of `run`.
    """
    loaded = request_of(request)
    stop_time = system_of(loaded).stop_time
    if not 0.0 <= pause_at < stop_time:
        given, end = told_apart(pause_at, stop_time)
        raise UsageError(f"pause at {given} s: expected a time from 0 to before stop_time {end} s")

    def simulate_into(recorder: ToFolder) -> Result | None:
        result = simulate(
            loaded, partial(_until, pause_at, recorder.folder.absolute()), recorder=recorder, progress=progress,
            announce=announce, engine=engine, in_process=in_process, time_limit=time_limit, memory_limit=memory_limit,
            pace=pace,
        )  # fmt: skip
        if result is None:
            recorder.finish()
        return result

    return keep_run(out, simulate_into, figures=figures, replaces=())


def _until(pause_at: float, folder: Path, simulation: PreparedRun, progress: Progress | None) -> bool:
    """The course of a run that is paused; writes its state into `folder`."""
    _expect_states(simulation)
    simulation.master.initialise()
    is_over = simulation.master.run(pause_at=nanoseconds(pause_at), progress=progress)
    if not is_over:
        _write(simulation, folder)
    return is_over


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
    pace: float | None = None,
) -> Result:
    """Resume the run paused in `folder` and run it to the end; `out`, which may be `folder`, receives its directory.

    All other arguments are those of `run`. Raises `UsageError` if there is no paused run, or if the scenario, its
    reference or an FMU has changed since the pause.
    """
    folder = Path(folder)
    clear(folder.parent)  # its results may be all but moved to their place
    if not (folder / STATE).is_file():
        raise UsageError(f"{folder}: expected the directory of a paused run; it has no {STATE}")
    request = load_request(folder / SCENARIO)
    read_state(folder / STATE)  # damage is found before the run

    def simulate_rest(recorder: Recorder) -> Result:
        result = simulate(
            request, partial(_rest, folder), recorder=recorder, progress=progress, announce=announce, engine=engine,
            in_process=in_process, time_limit=time_limit, memory_limit=memory_limit, pace=pace,
        )  # fmt: skip
        assert result is not None
        return result

    if out is None:
        return simulate_rest(InMemory())
    same = folder.resolve() == Path(out).resolve()
    result = keep_run(out, simulate_rest, figures=figures, replaces=(METRICS, STATE) if same else (METRICS,))
    assert result is not None
    return result


def _rest(folder: Path, simulation: PreparedRun, progress: Progress | None) -> bool:
    """The course of a run that was paused in `folder`."""
    state, saved = read_state(folder / STATE)
    _expect_same(state.pop("of"), simulation, folder)
    for chunk in InFolder(folder).chunks():
        simulation.recorder.take(chunk)
    simulation.master.restore(state, saved)
    return simulation.master.run(progress=progress)


def read_state(path: Path) -> tuple[dict[str, Any], dict[str, bytes]]:
    """Read what `Master.restore` needs from the file of a paused run.

    Raises `UsageError` for a file that is not as it was written.
    """
    try:
        with path.open("rb") as file, np.load(file, allow_pickle=False) as archive:
            text = str(archive["json"])
            parts = {name: archive[name].tobytes() for name in archive.files if name not in ("json", "digest")}
            whole = str(archive["digest"]) == _digest(text, parts)
    except Exception as error:  # numpy does not document what a damaged file raises
        raise UsageError(f"{path}: expected the state of a paused run, as it was written: {error}") from error
    if not whole:
        raise UsageError(f"{path}: expected the state of a paused run, as it was written")
    state: dict[str, Any] = json.loads(text)
    return state, parts


def _write(simulation: PreparedRun, folder: Path) -> None:
    state, parts = simulation.master.state(), simulation.master.saved()
    text = json.dumps({**state, "of": _hashes(simulation)})
    arrays = {name: np.frombuffer(part, dtype=np.uint8) for name, part in parts.items()}
    write_atomically(folder / SCENARIO, simulation.request.to_toml())
    strings = {"json": np.array(text), "digest": np.array(_digest(text, parts))}
    with new_file(folder / STATE) as new:
        np.savez(new, allow_pickle=False, **strings, **arrays)


def _digest(text: str, parts: dict[str, bytes]) -> str:
    """The hash of all parts of a state, by which a changed file is detected."""
    content = hashlib.sha256(text.encode())
    for name in sorted(parts):
        content.update(hashlib.sha256(parts[name]).digest())
    return content.hexdigest()


def _hashes(simulation: PreparedRun) -> dict[str, str]:
    """The hashes of all that a resumed run depends on beside its state."""
    return {
        SCENARIO: hashlib.sha256(simulation.request.to_toml().encode()).hexdigest(),
        **{f"the file of {name}": content_hash(path) for name, path in input_files(simulation.system).items()},
        **{f"the FMU of {name}": content_hash(instance.path) for name, instance in simulation.instances.items()},
    }


def _expect_states(simulation: PreparedRun) -> None:
    """Raise `UsageError` naming the components whose state cannot be saved."""
    without = [name for name, instance in simulation.instances.items() if not instance.model.saves_state]
    if without:
        raise UsageError(f"pause: the FMU of {', '.join(without)} {NO_STATE}")


def _expect_same(paused: dict[str, str], simulation: PreparedRun, folder: Path) -> None:
    for what, digest in _hashes(simulation).items():
        if digest != paused.get(what):
            raise UsageError(f"{folder}: {what} has changed since the run was paused; expected it unchanged")
