"""Modules of this project run in a process of their own, wherever the project lies and whatever folder is current."""

import os
import sys
from pathlib import Path

ROOT = str(Path(__file__).resolve().parents[2])
"""The folder in which the packages of the project lie"""

_MISLEADING = ("PYTHONHOME", "PYTHONPATH")
_ONE_THREAD = {"OPENBLAS_NUM_THREADS": "1"}
"""numpy's BLAS starts a thread a core where it is loaded, which wait busily: 0.1 s of CPU time of each process. Nothing
here is so large that they would be worth it, and sums of several threads may have other bits."""


def command(module: str, *arguments: object) -> list[str]:
    """What starts `module` in this Python."""
    return [sys.executable, "-m", module, *map(str, arguments)]


def environment(**variables: str) -> dict[str, str]:
    """This process's environment, with which the child finds the project's packages, and `variables`."""
    path = os.pathsep.join(filter(None, (ROOT, os.environ.get("PYTHONPATH"))))
    return {**_ONE_THREAD, **os.environ, "PYTHONPATH": path, **variables}


def one_thread() -> None:
    """Have numpy compute by one thread in this process, if it is not loaded yet and the environment does not say."""
    for name, value in _ONE_THREAD.items():
        os.environ.setdefault(name, value)


def misleading_variables() -> dict[str, str]:
    """Those of this process's environment that may have a Python take modules of another one."""
    return {name: os.environ[name] for name in _MISLEADING if os.environ.get(name)}


def undisturbed_environment() -> dict[str, str]:
    """`environment` without them."""
    kept = {name: value for name, value in os.environ.items() if name not in _MISLEADING}
    return {**_ONE_THREAD, **kept, "PYTHONPATH": ROOT}
