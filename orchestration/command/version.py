"""What `--version` says."""

from importlib.metadata import PackageNotFoundError, version
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from orchestration.command.answer import Answer

BESIDE = ("numpy", "fmpy", "pythonfmu", "pyarrow", "matplotlib", "scipy", "pandas", "dask")
"""Packages by which numbers, files and figures are made"""


def own() -> str:
    """The line with this package's version."""
    return f"quadcosim {_version('quadcosim')}"


def versions(*, everything: bool) -> "Answer":
    """This package's version, or everything's that a report of an error should name."""
    from orchestration.command.answer import Answer  # not before: `own` does without

    found = {"quadcosim": _version("quadcosim")}
    lines = [own()]
    if everything:
        import platform

        found |= {"python": platform.python_version(), "platform": platform.platform()}
        found |= {name: _version(name) for name in BESIDE}
        lines = [f"{name:<10}  {value}" for name, value in found.items()]
    return Answer(document=found, lines=lines)


def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return "not installed"
