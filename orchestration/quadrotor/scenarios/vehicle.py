"""Reads vehicle files; those that are shipped have names."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from orchestration.components.building.models import PATHS
from orchestration.foundation.basics.documents import read_toml
from orchestration.foundation.basics.errors import UsageError, did_you_mean, expected_name, prefixed
from orchestration.systems.system.component import Parameter, parameters_in
from orchestration.systems.system.vehicle import Vehicle

SHIPPED = Path(__file__).with_name("vehicles")
"""The folder of the vehicles that have names"""
ENDING = ".toml"
TABLES = ("plant", "controller", "controllers")
"""Tables of a vehicle file"""


def names() -> list[str]:
    """The names of the vehicles that are shipped."""
    return sorted(path.stem for path in SHIPPED.glob(f"*{ENDING}"))


def load_vehicle(name: str, folder: Path) -> Vehicle:
    """The vehicle of a name, or of a path that ends in .toml and is relative to `folder`.

    Parameters of single controllers are checked against their FMUs, which are built if need be. Raises `UsageError`
    for an unknown name, a file that cannot be read, or an unknown key in it.
    """
    path = folder / name if name.endswith(ENDING) else SHIPPED / f"{name}{ENDING}"
    if not name.endswith(ENDING) and name not in names():
        raise UsageError(f"vehicle {name}: {expected_name(name, names())}, or a path that ends in {ENDING}")
    tables = read_toml(path, "vehicle file")
    with prefixed(f"{path}: "):
        vehicle = _vehicle(path.stem, tables)
        for fmu, parameters in vehicle.controllers.items():
            _expect_parameters(fmu, parameters, path.parent)
        return vehicle


def _vehicle(name: str, tables: dict[str, Any]) -> Vehicle:
    for key, table in tables.items():
        if key not in TABLES or not isinstance(table, Mapping):
            listed = "the tables [plant], [controller] and [controllers.NAME] only"
            raise UsageError(f"{key}: expected {listed}{'' if key in TABLES else did_you_mean(key, TABLES)}")
    for fmu, table in tables.get("controllers", {}).items():
        if not isinstance(table, Mapping):
            raise UsageError(f"controllers.{fmu}: expected a table [controllers.NAME], NAME that of an FMU")
    return Vehicle(
        name=name,
        plant=parameters_in(tables.get("plant", {}), "plant"),
        controller=parameters_in(tables.get("controller", {}), "controller"),
        controllers={
            fmu: parameters_in(table, f"controllers.{fmu}") for fmu, table in tables.get("controllers", {}).items()
        },
    )


def _expect_parameters(fmu: str, parameters: Mapping[str, Parameter], folder: Path) -> None:
    """Raise `UsageError` for an invalid parameter of a controller, also of one that this flight does not use."""
    from orchestration.components.building.fmus import read_model  # not before: made where no FMU is read too
    from orchestration.systems.system.check import expect_parameter

    model = read_model(str(folder / fmu) if fmu.endswith(PATHS) else fmu)
    for name, value in parameters.items():
        expect_parameter(f"controllers.{fmu}.{name}", model, name, value)
