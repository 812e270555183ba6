"""Vehicles: parameters of a plant and of its controllers."""

from collections.abc import Mapping
from dataclasses import field
from pathlib import PurePath

from orchestration.components.building.models import CONTROLLERS, PATHS
from orchestration.foundation.basics.errors import UsageError, expected_name
from orchestration.foundation.basics.records import record
from orchestration.systems.system.component import Parameter


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
            if fmu not in CONTROLLERS and not fmu.endswith(PATHS):
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
