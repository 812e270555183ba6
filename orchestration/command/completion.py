"""What a shell proposes for a value: names that there are, looked up when they are asked for."""

from collections.abc import Callable, Iterable
from pathlib import Path

Complete = Callable[[str], list[str]]
"""What can stand where `incomplete` does; of nothing, the shell proposes files"""


def among(*names: str) -> Complete:
    """Some of a few names."""
    return lambda incomplete: starting(incomplete, names)


def controllers(incomplete: str) -> list[str]:
    """This project's controllers, and FMUs by their paths."""
    from orchestration.building.models import MODELS
    from orchestration.quadrotor.wiring import DEFAULT_PLANT

    return starting(incomplete, [name for name in MODELS if name != DEFAULT_PLANT]) + _files(incomplete, ".fmu")


def plants(incomplete: str) -> list[str]:
    """This project's plant, and FMUs by their paths."""
    from orchestration.quadrotor.wiring import DEFAULT_PLANT

    return starting(incomplete, [DEFAULT_PLANT]) + _files(incomplete, ".fmu")


def vehicles(incomplete: str) -> list[str]:
    """Vehicles that have a name, and files of others."""
    from orchestration.quadrotor.vehicle import ENDING, names

    return starting(incomplete, names()) + _files(incomplete, ENDING)


def presets(incomplete: str) -> list[str]:
    """Timings that have a name."""
    from orchestration.quadrotor.presets import PRESETS

    return starting(incomplete, PRESETS)


def starting(incomplete: str, names: Iterable[str]) -> list[str]:
    """Those names that go on from what is typed."""
    return [name for name in names if name.startswith(incomplete)]


def _files(incomplete: str, ending: str) -> list[str]:
    """Files of that ending and folders, by what is typed of a path."""
    folder = Path(incomplete) if incomplete.endswith("/") else Path(incomplete).parent
    typed = incomplete.rpartition("/")
    found = sorted(folder.iterdir()) if folder.is_dir() else []
    kept = [f"{each.name}/" if each.is_dir() else each.name for each in found if each.is_dir() or each.suffix == ending]
    return [f"{typed[0]}{typed[1]}{name}" for name in kept if name.startswith(typed[2]) and not name.startswith(".")]
