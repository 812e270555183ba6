"""The output of `--version`."""

from importlib.metadata import PackageNotFoundError, version
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from orchestration.command.registry import CommandResult

BESIDE = ("numpy", "fmpy", "pythonfmu", "pyarrow", "matplotlib", "scipy", "pandas", "dask")
"""Packages that affect numbers, files and figures"""


def own_version() -> str:
    """The line with this package's version."""
    return f"quadcosim {_version('quadcosim')}"


def versions(*, everything: bool) -> "CommandResult":
    """This package's version, or `everything` that an error report should state."""
    from orchestration.command.registry import CommandResult  # not before: `own_version` does without

    found = {"quadcosim": _version("quadcosim")}
    lines = [own_version()]
    if everything:
        import platform

        found |= {"python": platform.python_version(), "platform": platform.platform()}
        found |= {name: _version(name) for name in BESIDE}
        lines = [f"{name:<10}  {value}" for name, value in found.items()]
    return CommandResult(document=found, lines=lines)


def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return "not installed"
