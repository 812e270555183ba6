"""Unload FMUs, and delete what was unpacked for them, while others fly on; print how those flew.

The one unloaded first is the one whose files all instances of its model were imported from.
"""

import contextlib
import json
import sys
from pathlib import Path

from fmpy.fmi1 import FMICallException

from tests.fmus.flights import FLIGHTS, STEPS
from tests.fmus.instance import Instance

Rows = list[list[str]]


def failure(instance: Instance) -> str:
    """What the FMU says when its files are gone and a call fails."""
    with contextlib.suppress(FMICallException):
        instance.set({"mass": 1.0})
    return instance.messages[-1].text


def main(fmus: dict[str, Path]) -> dict[str, object]:
    first = {name: Instance(fmus[flight.model], anew=True) for name, flight in FLIGHTS.items()}
    second = {name: Instance(fmus[flight.model], anew=True) for name, flight in FLIGHTS.items()}
    rows: dict[str, Rows] = {}
    for instances in (first, second):
        for name, instance in instances.items():
            FLIGHTS[name].begin(instance)
            rows[name] = FLIGHTS[name].fly(instance, 0, STEPS // 2)
    for instance in first.values():
        instance.free()
    for name, instance in second.items():
        rows[name] += FLIGHTS[name].fly(instance, STEPS // 2, STEPS)
    said = [failure(instance) for instance in second.values()]
    for instance in second.values():
        instance.fmu.reset()
        instance.free()
    return {"rows": rows, "said": said}


if __name__ == "__main__":
    plant, controller = map(Path, sys.argv[1:])
    print(json.dumps(main({"QuadrotorPlant": plant, "UnifiedController": controller})))
