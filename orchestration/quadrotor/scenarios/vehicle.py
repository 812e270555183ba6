"""Vehicles: parameters of a plant and of its controllers, from vehicle files."""

from collections.abc import Mapping
from dataclasses import field
from pathlib import Path, PurePath
from typing import Any

from orchestration.components.building.models import MODELS
from orchestration.foundation.basics.documents import read_toml
from orchestration.foundation.basics.errors import UsageError, did_you_mean, expected_name
from orchestration.foundation.basics.records import record
from orchestration.quadrotor.scenarios.wiring import DEFAULT_PLANT
from orchestration.systems.system.component import Parameter
from orchestration.systems.system.parameters import parameters_in

SHIPPED = Path(__file__).with_name("vehicles")
"""The folder of the vehicles that have names"""
ENDING = ".toml"
CONTROLLERS = tuple(name for name in MODELS if name != DEFAULT_PLANT)
"""The FMUs of this project that control a vehicle"""
TABLES = ("plant", "controller", "controllers")
"""of a vehicle file"""


@record()
class Vehicle:
    """Parameters of the plant, of every controller, and of single controllers by the names of their FMUs.

    Raises `UsageError` for an unknown controller.
    """

    name: str
    """The name of the vehicle."""
    plant: Mapping[str, Parameter] = field(default_factory=dict)
    """Parameters of the plant by their names in the FMU, in its units."""
    controller: Mapping[str, Parameter] = field(default_factory=dict)
    """Parameters of every controller, likewise."""
    controllers: Mapping[str, Mapping[str, Parameter]] = field(default_factory=dict)
    """Further parameters of single controllers, by the name of an FMU of this project or the path of an .fmu file."""

    def __post_init__(self) -> None:
        for fmu in self.controllers:
            if fmu not in CONTROLLERS and not fmu.endswith(".fmu"):
                expected = f"{expected_name(fmu, CONTROLLERS)}, or the path of an .fmu file"
                raise UsageError(f"controllers.{fmu}: no controller of this project; {expected}")

    def with_parameters(self, *, plant: Mapping[str, Parameter], controller: Mapping[str, Parameter]) -> "Vehicle":
        """The same with other values for the plant and for every controller."""
        return Vehicle(
            name=self.name,
            plant={**self.plant, **plant},
            controller={**self.controller, **controller},
            controllers={fmu: {**parameters, **controller} for fmu, parameters in self.controllers.items()},
        )

    def parameters_for(self, controller: str) -> dict[str, Parameter]:
        """The parameters of the plant and of the controller whose FMU has this name or path, by target."""
        sides = {"plant": self.plant, "controller": self.for_controller(controller)}
        return {f"{side}.{name}": value for side, table in sides.items() for name, value in table.items()}

    def for_controller(self, fmu: str) -> dict[str, Parameter]:
        """The parameters of the controller whose FMU has this name or path, packed in any way."""
        values = dict(self.controller)
        for name, parameters in self.controllers.items():
            if PurePath(name).stem == PurePath(fmu).stem:
                values |= parameters
        return values


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
    try:
        vehicle = _vehicle(path.stem, tables)
        for fmu, parameters in vehicle.controllers.items():
            _expect_parameters(fmu, parameters, path.parent)
        return vehicle
    except UsageError as error:
        raise UsageError(f"{path}: {error}") from error


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
    from orchestration.components.building.fmus import locate  # not before: a vehicle is also made where no FMU is read
    from orchestration.components.fmi.model import read_model
    from orchestration.systems.system.check import expect_parameter

    model = read_model(locate(str(folder / fmu) if fmu.endswith(".fmu") else fmu))
    for name, value in parameters.items():
        expect_parameter(f"controllers.{fmu}.{name}", model, name, value)
