"""A component of a system: an FMU, its parameters, and how it is stepped."""

from collections.abc import Mapping
from dataclasses import field

from orchestration.foundation.basics.records import Scalar, record
from orchestration.foundation.basics.times import is_at_least
from orchestration.systems.system.choices import Align
from orchestration.systems.system.requirements import require, require_positive
from orchestration.systems.system.sampling import Sampling

Parameter = Scalar


@record()
class Component:
    """An FMU, its parameters, and how it is stepped: at sampling instants if it has `sampling`, else continuously."""

    fmu: str
    """The name of one of this project's FMUs, or the path of an .fmu file; in a file, relative to its folder."""
    parameters: Mapping[str, Parameter] = field(default_factory=dict)
    """The parameters to set, by their names in the FMU and in the units that it declares."""
    step: float | None = None
    """The distance of the communication points [s] of a component in continuous time; a component has either this or
    `sampling`."""
    sampling: Sampling | None = None
    """When a digital task runs; a component has either this or `step`, or neither if it is the task of a computer."""
    tolerance: float | None = None
    """The relative tolerance of the FMU's solver; default: that of the experiment that the FMU declares, if any."""
    align: Align = "exact"
    """The treatment of an instant between two points of a component that only takes its own fixed step: an error
    (exact), or it moves to the next point (next)."""
    record: tuple[str, ...] | None = None
    """The variables to record beside the exchanged ones; default: all outputs and local Reals."""

    def __post_init__(self) -> None:
        if self.tolerance is not None:
            require_positive(self, "tolerance")
        if self.step is not None:
            require_positive(self, "step")
            require(is_at_least(self.step, 1.0), "step", self.step, "at least a nanosecond")
        if self.sampling is not None:
            require(self.step is None, "step", self.step, "none beside sampling, whose period it follows")
