"""Vehicles: what a plant is made of and what its controllers are told of it, from files of their own."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path, PurePath
from typing import Any

from orchestration.basics.constructors import strict
from orchestration.basics.documents import read_toml
from orchestration.basics.errors import UsageError, expected_name
from orchestration.system.model import Parameter
from orchestration.system.parameters import parameters_in

SHIPPED = Path(__file__).with_name("vehicles")
"""Where the vehicles are that go by a name"""
ENDING = ".toml"


@strict()
@dataclass(frozen=True, kw_only=True)
class Vehicle:
    """Parameters of the plant, of every controller, and of single controllers by the names of their FMUs."""

    name: str
    """What the vehicle is called."""
    plant: Mapping[str, Parameter] = field(default_factory=dict)
    """What the plant is made of: parameters by their names in the FMU, in its units."""
    controller: Mapping[str, Parameter] = field(default_factory=dict)
    """What every controller is told of it, likewise."""
    controllers: Mapping[str, Mapping[str, Parameter]] = field(default_factory=dict)
    """What single controllers are told beside, by the names of their FMUs."""

    def with_parameters(self, *, plant: Mapping[str, Parameter], controller: Mapping[str, Parameter]) -> "Vehicle":
        """The same with other values of the plant, and of what every controller is told."""
        return Vehicle(
            name=self.name,
            plant={**self.plant, **plant},
            controller={**self.controller, **controller},
            controllers={fmu: {**parameters, **controller} for fmu, parameters in self.controllers.items()},
        )

    def told(self, controller: str) -> dict[str, Parameter]:
        """What the plant is made of, and what a controller whose FMU has this name or path is told of it, by target."""
        sides = {"plant": self.plant, "controller": self.for_controller(controller)}
        return {f"{side}.{name}": value for side, table in sides.items() for name, value in table.items()}

    def for_controller(self, fmu: str) -> dict[str, Parameter]:
        """The parameters of a controller whose FMU has this name or path."""
        return {**self.controller, **self.controllers.get(PurePath(fmu).stem, {})}


def names() -> list[str]:
    """The vehicles that are shipped."""
    return sorted(path.stem for path in SHIPPED.glob(f"*{ENDING}"))


def load_vehicle(given: str, folder: Path) -> Vehicle:
    """The vehicle of a name, or of a path that ends in .toml and starts at `folder`.

    Raises `UsageError` for a name that none has, a file that cannot be read, or what does not belong in it.
    """
    path = folder / given if given.endswith(ENDING) else SHIPPED / f"{given}{ENDING}"
    if not given.endswith(ENDING) and given not in names():
        raise UsageError(f"vehicle {given}: {expected_name(given, names())}, or a path that ends in {ENDING}")
    tables = read_toml(path, "vehicle file")
    try:
        return _vehicle(path.stem, tables)
    except UsageError as error:
        raise UsageError(f"{path}: {error}") from error


def _vehicle(name: str, tables: dict[str, Any]) -> Vehicle:
    for key, table in tables.items():
        if key not in ("plant", "controller", "controllers") or not isinstance(table, Mapping):
            raise UsageError(f"{key}: expected the tables [plant], [controller] and [controllers.NAME] only")
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
