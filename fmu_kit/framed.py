"""A slave whose variables may be in another axes convention than its equations."""

from fmu_kit.frames import Frame
from fmu_kit.interface import FixedParameter
from fmu_kit.slave import Slave


class Framed(Slave):
    """A slave with a choice of axes convention, for all of its variables that depend on axes."""

    frame = FixedParameter(
        "axes of all that is wired and set: inertial north-east-down and body forward-right-down (ned), or inertial "
        "east-north-up and body forward-left-up (enu)",
        start=Frame.NED,
    )

    @property
    def is_turned(self) -> bool:
        """Whether the chosen convention differs from that of the equations."""
        return self.frame == Frame.ENU  # type: ignore[no-any-return]
