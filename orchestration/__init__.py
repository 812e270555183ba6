"""Runs FMUs under a realistic digital clock. Its Python API is the package `quadcosim`, and is found here too."""

from importlib import import_module
from typing import Any

import orchestration.quadrotor.flight  # noqa: F401 - registers figures and analyses of flights in the tables of lower rooms


def __getattr__(name: str) -> Any:
    """What the API has under this name, for programs written when this package was the API."""
    api = import_module("quadcosim")
    if name not in api.__all__:
        raise AttributeError(f"module {__name__} has no attribute {name}")
    return getattr(api, name)
