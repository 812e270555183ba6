"""Fly several instances, of several FMUs, by turns in one process; print what each went through."""

import json
import sys
from contextlib import ExitStack
from pathlib import Path
from tempfile import TemporaryDirectory

import fmpy

from tests.fmus.flights import FLIGHTS, STEPS
from tests.fmus.instance import Instance


def main(fmus: dict[str, Path], shared: bool) -> dict[str, list[list[str]]]:
    """`shared`: instances of an FMU come from one unpacked folder, so from one loaded library."""
    with ExitStack() as stack:
        folders = {}
        for model, fmu in fmus.items() if shared else ():
            folders[model] = Path(stack.enter_context(TemporaryDirectory()))
            fmpy.extract(str(fmu), str(folders[model]))
        instances = {
            name: stack.enter_context(
                Instance(fmus[flight.model], unpacked=folders.get(flight.model), anew=not folders)
            )
            for name, flight in FLIGHTS.items()
        }
        for name, instance in instances.items():
            FLIGHTS[name].begin(instance)
        rows: dict[str, list[list[str]]] = {name: [] for name in FLIGHTS}
        for k in range(STEPS):
            for name, instance in instances.items():
                rows[name] += FLIGHTS[name].fly(instance, k, k + 1)
        return rows


if __name__ == "__main__":
    plant, controller, sharing = sys.argv[1:]
    print(json.dumps(main({"QuadrotorPlant": Path(plant), "UnifiedController": Path(controller)}, sharing == "shared")))
