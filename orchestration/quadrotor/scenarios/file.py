"""Reads scenario files: checks keys and types; the constructors check values."""

import dataclasses
from pathlib import Path
from typing import Any, TypeVar

from orchestration.components.building.models import PATHS
from orchestration.foundation.basics.documents import read_toml
from orchestration.foundation.basics.errors import UsageError, no_such_key, prefixed, shown
from orchestration.foundation.basics.typed_tables import parsed, table_of
from orchestration.quadrotor.scenarios.fmu_choice import FmuChoice
from orchestration.quadrotor.scenarios.nominal_model import hover_inputs
from orchestration.quadrotor.scenarios.scenario import Scenario
from orchestration.quadrotor.scenarios.timing import LOSSES, Timing, loss_as_written, preset_timing
from orchestration.quadrotor.scenarios.translation import SYSTEM, DisturbanceChoice, ReferenceChoice
from orchestration.quadrotor.scenarios.vehicle import load_vehicle
from orchestration.quadrotor.scenarios.wiring import DEFAULT_CONTROLLER, DEFAULT_PLANT
from orchestration.simulation.requests.kinds import RequestKind
from orchestration.systems.system.component import parameters_in
from orchestration.systems.system.file import DistributionTable, with_distributions

TimingTable = table_of(Timing, within=[DistributionTable])
ScenarioFile = table_of(
    Scenario,
    within=[TimingTable],
    vehicle=(str | None, None),
    controller=(dict[str, Any], {}),
    plant=(dict[str, Any], {}),
    reference=(dict[str, Any], {}),
    disturbance=(dict[str, Any], {}),
)
"""The tables of a scenario file; parameters of the FMUs are still nested as in the file"""


def load_scenario(path: str | Path) -> Scenario:
    """Read a scenario file; paths in it are relative to its folder.

    Raises `UsageError` for a file that cannot be read, an unknown key (naming the known ones) or a value of the wrong
    type.
    """
    path = Path(path)
    tables = read_toml(path, "scenario file")
    with prefixed(f"{path}: "):
        return scenario_from_tables(tables, path.parent)


def scenario_from_tables(tables: dict[str, Any], folder: Path) -> Scenario:
    """The scenario of a TOML document whose paths are relative to `folder`; raises `UsageError`."""
    with loss_as_written(timing if isinstance(timing := tables.get("timing"), dict) else ()):
        return _scenario(parsed(_expanded(tables), ScenarioFile), folder)


def _scenario(file: Any, folder: Path) -> Scenario:
    return Scenario(
        stop_time=file.stop_time,
        seed=file.seed,
        model_mismatch=file.model_mismatch,
        vehicle=None if file.vehicle is None else load_vehicle(file.vehicle, folder),
        controller=_choice("controller", file.controller, DEFAULT_CONTROLLER, folder),
        plant=_choice("plant", file.plant, DEFAULT_PLANT, folder),
        timing=Timing(**with_distributions("timing.", file.timing, folder)),
        reference=_signal("reference", file.reference, ReferenceChoice, folder),
        disturbance=_signal("disturbance", file.disturbance, DisturbanceChoice, folder),
        record=file.record,
        objectives=file.objectives,
    )


def _expanded(tables: dict[str, Any]) -> dict[str, Any]:
    """The tables with `timing.preset` and `timing.loss` expanded; keys of the file take precedence."""
    timing = tables.get("timing")
    if not isinstance(timing, dict):
        return tables
    written = {key: value for key, value in timing.items() if key not in Timing.SHORTHANDS}
    if "loss" in timing:
        written = {**dict.fromkeys(LOSSES, timing["loss"]), **written}
    if "preset" in timing:
        written = {**preset_timing(str(timing["preset"])), **written}
    return {**tables, "timing": written}


def _choice(side: str, table: dict[str, Any], default: str, folder: Path) -> FmuChoice:
    parameters = parameters_in(table, side)
    fmu = parameters.pop("fmu", default)
    if not isinstance(fmu, str):
        raise UsageError(f"{side}.fmu = {shown(fmu)}: expected the name of an FMU or a path")
    if fmu.endswith(PATHS):
        fmu = str(folder / fmu)
    return FmuChoice(fmu=fmu, parameters=parameters)


Signal = TypeVar("Signal", ReferenceChoice, DisturbanceChoice)


def _signal(place: str, table: dict[str, Any], kind: type[Signal], folder: Path) -> Signal:
    """A table with the fields of its kind, and parameters beside them."""
    own = [f.name for f in dataclasses.fields(kind) if f.name != "parameters"]
    fields: dict[str, Any] = {key: value for key, value in table.items() if key in own}
    parameters = {key: value for key, value in table.items() if key not in own}
    if parameters and not {"name", "file"} & {*fields}:
        beside = "; parameters beside name or file only"
        raise UsageError(no_such_key(f"{place}.", next(iter(parameters)), own, beside))
    for key, value in fields.items():
        if key == "drag":
            continue
        if not isinstance(value, str):
            raise UsageError(f"{place}.{key} = {shown(repr(value))}: expected a text")
    if "file" in fields:
        fields["file"] = folder / fields["file"]
    return kind(**fields, parameters=parameters)


SCENARIOS = RequestKind(
    default=Scenario, from_tables=scenario_from_tables, resting_inputs=hover_inputs, files=(SYSTEM,)
)
"""Scenarios as a kind of request"""
