"""Versions that an FMU carries. The project's own is in `pyproject.toml`; it is read from what was installed."""

import functools
import importlib.metadata
from typing import Any

PROJECT = "quadcosim"


@functools.cache
def project_version() -> str:
    """The version of this project. Raises `PackageNotFoundError` where it is not installed."""
    return importlib.metadata.version(PROJECT)


def generation_tool() -> str:
    """What made an FMU, as model descriptions say it."""
    return f"{PROJECT} {project_version()}"


def version_of(slave: type[Any]) -> str | None:
    """The version that a slave says it has; else that of this project for a slave that comes with it; else None."""
    said = getattr(slave, "version", None)
    if said:
        return str(said)
    own = importlib.metadata.distribution(PROJECT).read_text("top_level.txt") or ""
    return project_version() if slave.__module__.partition(".")[0] in own.split() else None
