"""Modules of this project run in a process of their own, wherever the project lies and whatever folder is current."""

import os
import sys
from pathlib import Path

ROOT = str(Path(__file__).resolve().parents[2])
"""The folder in which the packages of the project lie"""

_MISLEADING = ("PYTHONHOME", "PYTHONPATH")


def command(module: str, *arguments: object) -> list[str]:
    """What starts `module` in this Python."""
    return [sys.executable, "-m", module, *map(str, arguments)]


def environment(**variables: str) -> dict[str, str]:
    """This process's environment, with which the child finds the project's packages, and `variables`."""
    path = os.pathsep.join(filter(None, (ROOT, os.environ.get("PYTHONPATH"))))
    return {**os.environ, "PYTHONPATH": path, **variables}


def misleading_variables() -> dict[str, str]:
    """Those of this process's environment that may have a Python take modules of another one."""
    return {name: os.environ[name] for name in _MISLEADING if os.environ.get(name)}


def undisturbed_environment() -> dict[str, str]:
    """`environment` without them."""
    kept = {name: value for name, value in os.environ.items() if name not in _MISLEADING}
    return {**kept, "PYTHONPATH": ROOT}
