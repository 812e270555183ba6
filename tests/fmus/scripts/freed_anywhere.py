"""Free instances in every phase of their life, none of them terminated first unless that is the phase.

Prints in how many phases that was done, and whether an instance made afterwards flies as one made before.
"""

import contextlib
import gc
import json
import math
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

import fmpy
from fmpy.fmi1 import FMICallException

from tests.fmus.instance import Instance

REPETITIONS = 5


def in_initialisation_mode(instance: Instance) -> None:
    instance.fmu.setupExperiment(startTime=0.0)
    instance.fmu.enterInitializationMode()
    instance.everything()


def stepping(instance: Instance) -> None:
    instance.initialise({})
    instance.step(0.0, 0.01)


def stepping_back(instance: Instance) -> None:
    stepping(instance)
    instance.step(0.01, -1.0)


def terminated(instance: Instance) -> None:
    stepping(instance)
    instance.fmu.terminate()


def reset(instance: Instance) -> None:
    stepping(instance)
    instance.fmu.reset()


def holding_a_state(instance: Instance) -> None:
    """Which the master has forgotten to free."""
    stepping(instance)
    instance.fmu.getFMUstate()


def failed(call: Callable[[Instance], object]) -> Callable[[Instance], None]:
    def until_then(instance: Instance) -> None:
        with contextlib.suppress(FMICallException):
            call(instance)
            sys.exit("expected a failure")

    return until_then


PHASES: tuple[Callable[[Instance], object], ...] = (
    lambda instance: None,
    in_initialisation_mode,
    lambda instance: instance.initialise({}),
    stepping,
    terminated,
    reset,
    holding_a_state,
    failed(lambda instance: instance.set({"mass": math.nan})),
    failed(lambda instance: instance.initialise({"mass": -1.0})),
    failed(stepping_back),
)


def flown(fmu: Path, folder: Path) -> list[str]:
    """Every variable after a short flight."""
    with Instance(fmu, unpacked=folder) as instance:
        stepping(instance)
        return instance.everything()


def main(fmu: Path) -> dict[str, object]:
    with tempfile.TemporaryDirectory() as folder:
        fmpy.extract(str(fmu), folder)
        before, freed = flown(fmu, Path(folder)), 0
        for lead_there in PHASES * REPETITIONS:
            instance = Instance(fmu, unpacked=Path(folder))
            lead_there(instance)
            instance.free()
            gc.collect()
            freed += 1
        return {"freed": freed, "flies as before": flown(fmu, Path(folder)) == before}


if __name__ == "__main__":
    print(json.dumps(main(Path(sys.argv[1]))))
