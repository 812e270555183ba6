"""Modules of this project run in a process of their own, wherever the project lies and whatever folder is current."""

import os
import sys
from pathlib import Path

_ROOT = Path(__file__).resolve().parent.parent


def command(module: str, *arguments: object) -> list[str]:
    """What starts `module` in this Python."""
    return [sys.executable, "-m", module, *map(str, arguments)]


def environment(**variables: str) -> dict[str, str]:
    """This process's environment, with which the child finds the project's packages, and `variables`."""
    path = os.pathsep.join(filter(None, (str(_ROOT), os.environ.get("PYTHONPATH"))))
    return {**os.environ, "PYTHONPATH": path, **variables}
