"""Stopping a run at a communication point and going on later, in another process, to the same bits."""

import json
from pathlib import Path
from typing import Any

import numpy as np

from orchestration.errors import UsageError
from orchestration.flight import Announce, Flight, Progress, prepared, provenance
from orchestration.result import Result
from orchestration.run_directory import SCENARIO, STATE, replaced_folder
from orchestration.scenario import Scenario
from orchestration.scenario_file import load_scenario
from orchestration.timing import nanoseconds

_ARRAYS = ("plant", "controller", "row", "rows", "received")
"""Parts of a master's state that are bytes; the rest is JSON."""


def fly_until(
    scenario: Scenario,
    pause_at: float,
    folder: str | Path,
    *,
    progress: Progress | None = None,
    announce: Announce | None = None,
) -> Result | None:
    """Fly to the first communication point from `pause_at` [s] and write the state into `folder`.

    Returns None, or the result if the run was over before.
    """
    if not 0.0 <= pause_at < scenario.stop_time:
        raise UsageError(
            f"pause at {pause_at:g} s: expected a time from 0 to before stop_time {scenario.stop_time:g} s"
        )
    with prepared(scenario, announce) as flight:
        flight.master.initialise()
        if flight.master.run(pause_at=nanoseconds(pause_at), progress=progress):
            return flight.result()
        _write(flight, Path(folder))
        return None


def resume(folder: str | Path, *, progress: Progress | None = None, announce: Announce | None = None) -> Result:
    """Go on with the run paused in `folder`, to the end.

    Raises `UsageError` if there is none, or if an FMU is not the one that it was paused with.
    """
    folder = Path(folder)
    if not (folder / STATE).is_file():
        raise UsageError(f"{folder}: expected the directory of a paused run; it has no {STATE}")
    scenario = load_scenario(folder / SCENARIO)
    with np.load(folder / STATE, allow_pickle=False) as archive:
        state: dict[str, Any] = json.loads(str(archive["json"]))
        state |= {name: archive[name].tobytes() for name in _ARRAYS}
    with prepared(scenario, announce) as flight:
        _expect_same_fmus(state.pop("fmus"), flight)
        flight.master.restore(state)
        flight.master.run(progress=progress)
        return flight.result()


def _write(flight: Flight, folder: Path) -> None:
    state = flight.master.state()
    arrays = {name: np.frombuffer(state.pop(name), dtype=np.uint8) for name in _ARRAYS}
    state["fmus"] = _guids(flight)
    with replaced_folder(folder) as partial:
        (partial / SCENARIO).write_text(flight.scenario.to_toml(), encoding="utf-8")
        np.savez(partial / STATE, allow_pickle=False, json=np.array(json.dumps(state)), **arrays)


def _guids(flight: Flight) -> dict[str, str]:
    fmus = provenance(flight.plant, flight.controller)["fmus"]
    return {side: fmu["guid"] for side, fmu in fmus.items()}


def _expect_same_fmus(paused: dict[str, str], flight: Flight) -> None:
    for side, guid in _guids(flight).items():
        if guid != paused[side]:
            raise UsageError(f"{side}: FMU with GUID {guid}, expected {paused[side]} as when the run was paused")
