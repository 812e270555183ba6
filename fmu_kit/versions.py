"""Versions that an FMU contains. The project's is set in `pyproject.toml` and read from the installed package."""

import functools
import importlib.metadata
from typing import Any

PROJECT = "quadcosim"


@functools.cache
def project_version() -> str:
    """The version of this project. Raises `PackageNotFoundError` where it is not installed."""
    return importlib.metadata.version(PROJECT)


def generation_tool() -> str:
    """The generation tool that model descriptions name."""
    return f"{PROJECT} {project_version()}"


def version_of(slave: type[Any]) -> str | None:
    """The version that a slave declares; else that of this project for a slave that comes with it; else None."""
    declared = getattr(slave, "version", None)
    if declared:
        return str(declared)
    own = importlib.metadata.distribution(PROJECT).read_text("top_level.txt") or ""
    return project_version() if slave.__module__.partition(".")[0] in own.split() else None
