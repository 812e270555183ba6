"""A slave that may be wired in another convention for axes than that of its equations."""

from fmu_kit.frames import Frame
from fmu_kit.interface import FixedParameter
from fmu_kit.slave import Slave


class Framed(Slave):
    """Its variables, but for those that no axes matter to, are in a convention that is chosen."""

    frame = FixedParameter(
        "axes of all that is wired and set: inertial north-east-down and body forward-right-down (ned), or inertial "
        "east-north-up and body forward-left-up (enu)",
        start=Frame.NED,
    )

    @property
    def is_turned(self) -> bool:
        """Whether that is another one than the equations have."""
        return self.frame == Frame.ENU  # type: ignore[no-any-return]
