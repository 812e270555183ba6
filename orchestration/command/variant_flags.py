"""The flags that fix parameters of a slave when it is built."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from orchestration.basics.errors import UsageError
from orchestration.command import completion
from orchestration.command.flags import assigned

if TYPE_CHECKING:
    from fmu_kit.bundle import Target


_NO_PRODUCTS = dict.fromkeys(("inertia.xy", "inertia.xz", "inertia.yz"), 0.0)
"""Of a vehicle whose file says nothing of them"""


@dataclass(frozen=True, kw_only=True)
class VariantFlags:
    """What was given on the command line."""

    set: Annotated[
        list[str] | None,
        typer.Option(
            "--set",
            metavar="NAME=V",
            help="Fix a parameter of one slave: it is a constant then, and what it turns off is gone; may be repeated.",
            show_default=False,
        ),
    ] = None
    vehicle: Annotated[
        str | None,
        typer.Option(
            "--vehicle",
            metavar="NAME|FILE",
            help="Fix what a vehicle is made of, or what a controller is told of it; --set comes after it.",
            autocompletion=completion.vehicles,
            show_default=False,
        ),
    ] = None
    name: Annotated[
        str | None,
        typer.Option(
            "--name", metavar="NAME", help="What the slave is called whose parameters are fixed.", show_default=False
        ),
    ] = None

    @property
    def are_given(self) -> bool:
        """Whether any is."""
        return self != VariantFlags()

    def applied_to(self, slaves: "list[Target]") -> "list[Target]":
        """The slaves; with any of these flags there has to be one, and it is fixed. Raises `UsageError`."""
        if not self.are_given:
            return slaves
        if len(slaves) != 1:
            listed = ", ".join(slave.model for slave in slaves)
            raise UsageError(f"--set, --vehicle and --name are of one slave: expected FOLDER/NAME for one of {listed}")
        from orchestration.building.builder import with_fixed

        (slave,) = slaves
        values = {**self._told(slave), **assigned("set", self.set)}
        return [with_fixed(slave, slave.model if self.name is None else self.name, values)]

    def _told(self, slave: "Target") -> "dict[str, float | int | bool | str]":
        if self.vehicle is None:
            return {}
        from orchestration.building.models import MODELS
        from orchestration.quadrotor.vehicle import load_vehicle
        from orchestration.quadrotor.wiring import DEFAULT_PLANT

        if slave.model not in MODELS:
            raise UsageError(f"--vehicle: expected one of {', '.join(MODELS)}; {slave.model} is none of them")
        vehicle = load_vehicle(self.vehicle, Path())
        told = vehicle.plant if slave.model == DEFAULT_PLANT else vehicle.for_controller(slave.model)
        return {**_NO_PRODUCTS, **told}
