"""Shell completion of values: existing names, looked up on demand."""

from collections.abc import Callable, Iterable
from pathlib import Path

Complete = Callable[[str], list[str]]
"""Completions of an incomplete value; if there are none, the shell proposes files"""


def among(*names: str) -> Complete:
    """Completion among fixed names."""
    return lambda incomplete: starting(incomplete, names)


def controllers(incomplete: str) -> list[str]:
    """This project's controllers, and FMUs and files of controllers in C by their paths."""
    from orchestration.components.building.models import MODELS, PATHS
    from orchestration.quadrotor.scenarios.wiring import DEFAULT_PLANT

    return starting(incomplete, [name for name in MODELS if name != DEFAULT_PLANT]) + _files(incomplete, *PATHS)


def plants(incomplete: str) -> list[str]:
    """This project's plant, and FMUs by their paths."""
    from orchestration.quadrotor.scenarios.wiring import DEFAULT_PLANT

    return starting(incomplete, [DEFAULT_PLANT]) + _files(incomplete, ".fmu")


def vehicles(incomplete: str) -> list[str]:
    """The names of vehicles, and vehicle files."""
    from orchestration.quadrotor.scenarios.vehicle import ENDING, names

    return starting(incomplete, names()) + _files(incomplete, ENDING)


def presets(incomplete: str) -> list[str]:
    """The names of presets of timings."""
    from orchestration.quadrotor.scenarios.timing import PRESETS

    return starting(incomplete, PRESETS)


def starting(incomplete: str, names: Iterable[str]) -> list[str]:
    """The names that begin with the incomplete value."""
    return [name for name in names if name.startswith(incomplete)]


def _files(incomplete: str, *endings: str) -> list[str]:
    """Files with one of these endings, and folders, that begin with the incomplete path."""
    folder = Path(incomplete) if incomplete.endswith("/") else Path(incomplete).parent
    typed = incomplete.rpartition("/")
    entries = sorted(folder.iterdir()) if folder.is_dir() else []
    fitting = [each for each in entries if each.is_dir() or each.suffix in endings]
    kept = [f"{each.name}/" if each.is_dir() else each.name for each in fitting]
    return [f"{typed[0]}{typed[1]}{name}" for name in kept if name.startswith(typed[2]) and not name.startswith(".")]
