"""Commands and environments to run modules of this project as processes, whatever the working directory."""

import os
import sys
from dataclasses import dataclass
from pathlib import Path

ROOT = str(Path(__file__).resolve().parents[3])
"""The folder in which the packages of the project lie"""

_MISLEADING = ("PYTHONHOME", "PYTHONPATH")
_ONE_THREAD = {"OPENBLAS_NUM_THREADS": "1"}
"""NumPy's BLAS starts a thread per core when it is loaded, which wait busily: 0.1 s of CPU time of each process. No
matrix here is large enough to profit, and sums of several threads may differ in the last bits."""


@dataclass(frozen=True)
class Module:
    """A module of this project with a function `main` of texts, which is to be a process."""

    name: str
    arguments: tuple[str, ...]
    loads: tuple[str, ...] = ()
    """Modules that it will load"""

    @classmethod
    def of(cls, name: str, *arguments: object) -> "Module":
        """With its arguments as texts."""
        return cls(name, tuple(map(str, arguments)))

    @property
    def command(self) -> list[str]:
        """What runs it in a new Python."""
        return command(self.name, *self.arguments)


def checkout() -> Path | None:
    """The checkout of the project that this process runs from; None if the package is installed."""
    return Path(ROOT) if os.path.isfile(os.path.join(ROOT, "pyproject.toml")) else None


def command(module: str, *arguments: object) -> list[str]:
    """The command that runs `module` in this Python."""
    return [sys.executable, "-m", module, *map(str, arguments)]


def environment(**variables: str) -> dict[str, str]:
    """This process's environment with the project's packages on the path, and `variables`."""
    path = os.pathsep.join(filter(None, (ROOT, os.environ.get("PYTHONPATH"))))
    return {**_ONE_THREAD, **os.environ, "PYTHONPATH": path, **variables}


def one_thread() -> None:
    """Limit NumPy to one thread in this process, unless it is loaded already or the environment says otherwise."""
    for name, value in _ONE_THREAD.items():
        os.environ.setdefault(name, value)


def misleading_variables() -> dict[str, str]:
    """Variables of this process's environment that may make a Python load modules of another one."""
    return {name: os.environ[name] for name in _MISLEADING if os.environ.get(name)}


def undisturbed_environment() -> dict[str, str]:
    """`environment` without the misleading variables."""
    kept = {name: value for name, value in os.environ.items() if name not in _MISLEADING}
    return {**_ONE_THREAD, **kept, "PYTHONPATH": ROOT}
