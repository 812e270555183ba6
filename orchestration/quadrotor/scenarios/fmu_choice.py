"""The choice of an FMU with its parameters, and of the variables to record."""

from dataclasses import field

from orchestration.foundation.basics.records import record
from orchestration.systems.system.component import Parameter


@record()
class FmuChoice:
    """An FMU, by name or path, and its parameters."""

    fmu: str
    """The name of one of this project's FMUs, as `UnifiedController` or `native/QuadrotorPlant`, or the path of an .fmu
    file."""
    parameters: dict[str, Parameter] = field(default_factory=dict)
    """The parameters to set, by their names in the FMU and in the units that it declares."""


@record("record.")
class Record:
    """Variables to record beside those that are exchanged; None: all outputs and locals."""

    plant: tuple[str, ...] | None = None
    """The variables of the plant to record; None: all outputs and locals."""
    controller: tuple[str, ...] | None = None
    """The variables of the controller to record; None: all outputs and locals."""
