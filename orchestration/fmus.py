"""Where FMUs are: finds them by name, builds those that are missing or whose sources have changed."""

import os
import subprocess
from collections.abc import Callable, Iterable
from pathlib import Path

from fmu_kit import packaging
from orchestration import child
from orchestration.errors import QuadcosimError, UsageError
from orchestration.wiring import MODELS


def default_folder() -> Path:
    """`fmus/` of the project, or the user's cache directory where that is not there to be written."""
    root = Path(__file__).resolve().parent.parent
    folder = root / "fmus"
    if (root / "pyproject.toml").is_file() and os.access(folder, os.W_OK):
        return folder
    import platformdirs

    return Path(platformdirs.user_cache_dir("quadcosim")) / "fmus"


def locate(fmu: str, announce: Callable[[str], None] | None = None) -> Path:
    """The .fmu for the name of one of this project's FMUs, built first if need be, or for a path.

    Raises `UsageError` naming the valid names if there is none; `announce` hears of a build.
    """
    if fmu in MODELS:
        folder = default_folder()
        if out_of_date([fmu], folder):
            if announce is not None:
                announce(f"building {folder / fmu}.fmu")
            build([fmu], folder, announce)
        return folder / f"{fmu}.fmu"
    path = Path(fmu)
    if path.suffix == ".fmu" and path.is_file():
        return path
    raise UsageError(f"fmu = {fmu}: expected {' or '.join(MODELS)}, or the path of an .fmu file")


def out_of_date(names: Iterable[str], folder: Path) -> list[str]:
    """Those of this project's FMUs that are missing in `folder` or carry another hash than the sources."""
    return [
        name
        for name in names
        if packaging.read_source_hash(folder / f"{name}.fmu") != packaging.source_hash(_target(name))
    ]


def build(names: Iterable[str], folder: Path, announce: Callable[[str], None] | None = None) -> list[Path]:
    """Build FMUs of this project into `folder`, in a process of its own; their paths.

    `announce` hears, a line each, of what could not be packed. Raises `QuadcosimError` with what the build said if
    it fails.
    """
    targets = [MODELS[name] for name in names]
    done = subprocess.run(
        child.command("fmu_kit.packaging", folder.resolve(), *targets),
        capture_output=True, text=True, env=child.environment(), check=False,
    )  # fmt: skip
    if done.returncode != 0:
        lines = done.stderr.strip().splitlines() or ["no output"]
        raise QuadcosimError(f"building {', '.join(targets)} in {folder} failed: {lines[-1]}")
    if announce is not None:
        for line in done.stderr.splitlines():
            announce(line)
    return [Path(line) for line in done.stdout.splitlines()]


def _target(name: str) -> packaging.Target:
    return packaging.Target.parse(MODELS[name])
