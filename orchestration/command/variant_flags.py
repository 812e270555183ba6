"""The flags that fix parameters of a slave when it is built."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from orchestration.command import completion
from orchestration.command.flags import assigned
from orchestration.command.options import option
from orchestration.foundation.basics.errors import UsageError

if TYPE_CHECKING:
    from fmu_kit.bundle import Target


_NO_PRODUCTS = dict.fromkeys(("inertia.xy", "inertia.xz", "inertia.yz"), 0.0)
"""Values for a vehicle file without them"""


@dataclass(frozen=True, kw_only=True)
class VariantFlags:
    """The flags on the command line."""

    set: Annotated[
        list[str] | None,
        option(
            "--set",
            "Fix a parameter of one slave as a constant; code that it turns off is removed; may be repeated.",
            "NAME=V",
        ),
    ] = None
    vehicle: Annotated[
        str | None,
        option(
            "--vehicle",
            "Fix the parameters of a vehicle, or of a controller for it; --set takes precedence.",
            "NAME|FILE",
            autocompletion=completion.vehicles,
        ),
    ] = None
    name: Annotated[str | None, option("--name", "Name of the slave with fixed parameters.", "NAME")] = None

    @property
    def is_set(self) -> bool:
        """Whether any of the flags is set."""
        return self != VariantFlags()

    def applied_to(self, slaves: "list[Target]") -> "list[Target]":
        """The slaves; with any of these flags the only one, with fixed parameters. Raises `UsageError` for several."""
        if not self.is_set:
            return slaves
        if len(slaves) != 1:
            listed = ", ".join(slave.model for slave in slaves)
            raise UsageError(f"--set, --vehicle and --name: expected one slave, FOLDER/NAME for one of {listed}")
        from orchestration.components.building.builder import with_fixed

        (slave,) = slaves
        values = {**self._vehicle_parameters(slave), **assigned("set", self.set)}
        return [with_fixed(slave, slave.model if self.name is None else self.name, values)]

    def _vehicle_parameters(self, slave: "Target") -> "dict[str, float | int | bool | str]":
        if self.vehicle is None:
            return {}
        from orchestration.components.building.models import MODELS
        from orchestration.quadrotor.scenarios.vehicle import load_vehicle
        from orchestration.quadrotor.scenarios.wiring import DEFAULT_PLANT

        if slave.model not in MODELS:
            raise UsageError(f"--vehicle: expected one of {', '.join(MODELS)}; {slave.model} is none of them")
        vehicle = load_vehicle(self.vehicle, Path())
        parameters = vehicle.plant if slave.model == DEFAULT_PLANT else vehicle.for_controller(slave.model)
        return {**_NO_PRODUCTS, **parameters}
