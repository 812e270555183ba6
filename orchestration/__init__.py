"""Runs FMUs under a realistic digital clock. Its Python API is the package `quadcosim`, and is found here too."""

import os
import sys
from importlib import import_module
from typing import Any


def _tell(kind: type[BaseException], *_: object) -> None:
    """Print what has ended the start of the command, without a traceback."""
    if kind is MemoryError:
        print("quadcosim: there is not enough memory", file=sys.stderr)


try:
    import orchestration.quadrotor.flight  # noqa: F401 - registers figures and analyses of flights in the tables of lower rooms
except (KeyboardInterrupt, MemoryError):
    if os.path.basename(sys.argv[0]) == "quadcosim":  # the script is not yet in its `main`
        sys.excepthook = _tell
    raise


def __getattr__(name: str) -> Any:
    """What the API has under this name, for programs written when this package was the API."""
    api = import_module("quadcosim")
    if name not in api.__all__:
        raise AttributeError(f"module {__name__} has no attribute {name}")
    return getattr(api, name)
