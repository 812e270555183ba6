"""What `--version` says."""

import platform
from importlib.metadata import PackageNotFoundError, version

from orchestration.command.answer import Answer

BESIDE = ("numpy", "fmpy", "pythonfmu", "pyarrow", "matplotlib", "scipy", "pandas", "dask")
"""Packages by which numbers, files and figures are made"""


def versions(*, everything: bool) -> Answer:
    """This package's version, or everything's that a report of an error should name."""
    found = {"quadcosim": _version("quadcosim")}
    lines = [f"quadcosim {found['quadcosim']}"]
    if everything:
        found |= {"python": platform.python_version(), "platform": platform.platform()}
        found |= {name: _version(name) for name in BESIDE}
        lines = [f"{name:<10}  {value}" for name, value in found.items()]
    return Answer(document=found, lines=lines)


def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return "not installed"
