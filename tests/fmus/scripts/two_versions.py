"""Load FMUs of several versions of one model, beside an installed project of yet another; print their commands.

Arguments: the folder of the installed project, whether it is imported before or after, and the FMUs in the
order of loading.
"""

import importlib
import json
import sys
from contextlib import ExitStack
from pathlib import Path
from types import ModuleType

from tests.fmus.expected import COMMAND, MEASUREMENT
from tests.fmus.instance import Instance

INSTALLED = (
    "fmu_kit",
    "controller_fmu",
    "controller_fmu.sliding_mode.law",
    "controller_fmu.sliding_mode.slave",
    "pythonfmu",
)


def import_installed() -> list[ModuleType]:
    """The project that the user has installed, by its own names."""
    return [importlib.import_module(name) for name in INSTALLED]


def main(installed: str, when: str, fmus: list[str]) -> dict[str, object]:
    for name in [name for name in sys.modules if name.partition(".")[0] in INSTALLED]:
        del sys.modules[name]  # what the helpers of this script have imported
    sys.path.insert(0, installed)
    modules = import_installed() if when == "before" else []
    commands = []
    with ExitStack() as stack:
        instances = [stack.enter_context(Instance(Path(fmu))) for fmu in fmus]
        for instance in instances:  # all are loaded before the first flies
            instance.initialise(MEASUREMENT)
        for k in range(3):
            for instance in instances:
                instance.step(0.01 * k, 0.01)
        commands = [instance.get(*COMMAND) for instance in instances]
    modules = modules or import_installed()
    return {
        "commands": commands,
        "installed is the user's": all(str(module.__file__).startswith(installed) for module in modules),
    }


if __name__ == "__main__":
    print(json.dumps(main(sys.argv[1], sys.argv[2], sys.argv[3:])))
