"""Make and free instances of both FMUs from several threads at once; print what became of the import path."""

import json
import sys
from pathlib import Path
from tempfile import TemporaryDirectory
from threading import Thread

import fmpy
from fmpy import fmi2

from tests.extent import tries

THREADS, REPETITIONS = 8, tries(100, sampled=8)
SWITCH_INTERVAL = 1e-5
"""[s]; Python's own 5 ms would let most instantiations run through."""


def load(fmu: Path, folder: str) -> fmi2.FMU2Slave:
    """Not from the threads: fmpy changes the working directory meanwhile."""
    fmpy.extract(str(fmu), folder)
    description = fmpy.read_model_description(str(fmu))
    return fmi2.FMU2Slave(
        guid=description.guid,
        unzipDirectory=folder,
        modelIdentifier=description.coSimulation.modelIdentifier,
        instanceName="instance",
    )


def main(fmus: list[Path]) -> dict[str, object]:
    made: list[bool] = []

    def make_and_free(fmu: fmi2.FMU2Slave) -> None:
        for _ in range(REPETITIONS):
            fmu.instantiate()
            made.append(True)
            fmu.fmi2FreeInstance(fmu.component)

    path = list(sys.path)
    folders = [TemporaryDirectory() for _ in range(THREADS)]
    loaded = [load(fmus[i % len(fmus)], folder.name) for i, folder in enumerate(folders)]
    threads = [Thread(target=make_and_free, args=(fmu,)) for fmu in loaded]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    return {"made": len(made), "path kept": sys.path == path}


if __name__ == "__main__":
    sys.setswitchinterval(SWITCH_INTERVAL)
    print(json.dumps(main([Path(fmu) for fmu in sys.argv[1:]])))
