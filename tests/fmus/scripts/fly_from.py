"""Unpack the controller FMU into folders, tell it in some form where its resources are; print its command in each."""

import ctypes
import functools
import json
import sys
from collections.abc import Callable
from pathlib import Path

import fmpy
from fmpy import fmi2

from tests.fmus.expected import COMMAND, MEASUREMENT
from tests.fmus.process import in_a_copy

FORMS: dict[str, Callable[[Path], str]] = {
    "URI": Path.as_uri,
    "URI with a slash at its end": lambda path: path.as_uri() + "/",
    "URI with one slash": lambda path: path.as_uri().replace("file:///", "file:/"),  # as Java writes it
    "URI with a host": lambda path: path.as_uri().replace("file://", "file://localhost"),
    "path": str,
    "path with escapes": lambda path: path.as_uri().removeprefix("file://"),
}


def command(fmu: Path, folder: Path, form: str) -> list[float]:
    description = fmpy.read_model_description(str(fmu))
    references = {v.name: v.valueReference for v in description.modelVariables}
    fmpy.extract(str(fmu), str(folder))
    controller = fmi2.FMU2Slave(
        guid=description.guid,
        unzipDirectory=str(folder),
        modelIdentifier=description.coSimulation.modelIdentifier,
    )
    controller.callbacks = fmi2.defaultCallbacks
    controller.component = controller.fmi2Instantiate(
        b"controller",
        fmi2.fmi2CoSimulation,
        description.guid.encode(),
        FORMS[form](folder / "resources").encode(),
        ctypes.byref(controller.callbacks),
        False,
        True,
    )
    controller.setReal([references[name] for name in MEASUREMENT], list(MEASUREMENT.values()))
    controller.setupExperiment()
    controller.enterInitializationMode()
    controller.exitInitializationMode()
    command = controller.getReal([references[name] for name in COMMAND])
    controller.freeInstance()
    return [float(value) for value in command]


def main(fmu: Path, places: list[tuple[str, str]]) -> list[list[float]]:
    """The folder and the form of each place; in processes that have loaded no other."""
    return [in_a_copy(functools.partial(command, fmu, Path(folder), form)) for folder, form in places]


if __name__ == "__main__":
    print(json.dumps(main(Path(sys.argv[1]), json.loads(sys.argv[2]))))
