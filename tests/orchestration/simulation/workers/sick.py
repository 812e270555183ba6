"""A plant that ends its process at chosen masses."""

from pathlib import Path

from orchestration.components.building import fmus
from orchestration.quadrotor.scenarios.wiring import DEFAULT_PLANT
from tests.fmus.archive import files_of
from tests.fmus.damage import with_its_guid, write_fmu

ABORTS, KILLED, SPENT, WAITS = 1.11, 1.13, 1.14, 1.15
"""Masses at which the first step aborts, kills the process, leaves it dying for the next run, or waits while `WAIT`."""
WAIT = "QUADCOSIM_WAIT"
"""environment variable that is set"""

_BEFORE = "        body, wind, actuators = self._body, self._wind, self._actuators\n"
_SICKNESS = f"""
        import os
        mass = self.mass
        if mass == {ABORTS}:
            os.abort()
        if mass == {KILLED}:
            os.kill(os.getpid(), 9)
        while mass == {WAITS} and "{WAIT}" in os.environ:
            pass
        if mass != {SPENT} and "QUADCOSIM_SPENT" in os.environ:
            os.abort()
        if mass == {SPENT}:
            os.environ["QUADCOSIM_SPENT"] = "the next run ends this process"
"""


def sick_plant(folder: Path) -> Path:
    """The FMU, in `folder`."""
    files = files_of(fmus.locate(DEFAULT_PLANT))
    (name,) = (name for name in files if name.endswith("plant_fmu/slave.py"))
    text = files[name].decode()
    assert _BEFORE in text
    files[name] = text.replace(_BEFORE, _SICKNESS + _BEFORE).encode()
    path = folder / "sick.fmu"
    write_fmu(path, with_its_guid(files))
    return path
