"""Writes a scenario as the text of a scenario file."""

import dataclasses
from pathlib import Path
from typing import TYPE_CHECKING, Any

from orchestration.components.building.models import PATHS
from orchestration.quadrotor.scenarios.fmu_choice import FmuChoice
from orchestration.quadrotor.scenarios.translation import DisturbanceChoice, ReferenceChoice
from orchestration.systems.system.file_tables import in_toml

if TYPE_CHECKING:
    from orchestration.quadrotor.scenarios.scenario import Scenario


def text_of(scenario: "Scenario") -> str:
    """The file that loads as this scenario, with the parameters of its vehicle written out."""
    import tomli_w

    resolved = scenario.resolved()
    written = ((f.name, in_toml(getattr(scenario.timing, f.name))) for f in dataclasses.fields(scenario.timing))
    timing = {key: value for key, value in written if value is not None and value != {}}
    tables: dict[str, Any] = {
        "stop_time": scenario.stop_time,
        "seed": scenario.seed,
        **({"model_mismatch": True} if scenario.model_mismatch else {}),
        "controller": _fmu_table(resolved.controller),
        "plant": _fmu_table(resolved.plant),
        "timing": timing,
    }
    for name in ("reference", "disturbance"):
        tables |= {name: table} if (table := _signal_table(getattr(scenario, name))) else {}
    record = {key: list(value) for key, value in dataclasses.asdict(scenario.record).items() if value is not None}
    if record:
        tables["record"] = record
    if scenario.objectives:
        tables["objectives"] = dict(scenario.objectives)
    return tomli_w.dumps(tables)


def _signal_table(choice: ReferenceChoice | DisturbanceChoice) -> dict[str, Any]:
    """A choice as a table that is valid in any folder; empty for the default."""
    table = {
        f.name: getattr(choice, f.name)
        for f in dataclasses.fields(choice)
        if f.name not in ("file", "parameters") and getattr(choice, f.name) != f.default
    }
    return {**table, **({} if choice.file is None else {"file": str(choice.file.absolute())}), **choice.parameters}


def _fmu_table(choice: FmuChoice) -> dict[str, Any]:
    """A choice as a table that is valid in any folder."""
    fmu = str(Path(choice.fmu).absolute()) if choice.fmu.endswith(PATHS) else choice.fmu
    return {"fmu": fmu, **choice.parameters}
