"""Copies of the project's sources in another place, changed, and built from there."""

import shutil
import sys
from pathlib import Path
from subprocess import CompletedProcess

from orchestration.components.building.models import MODELS
from tests.fmus.process import run
from tests.places import ROOT

PACKAGES = ("fmu_kit", "controller_fmu", "plant_fmu")


def copy_sources(folder: Path) -> Path:
    """The packages that FMUs are built from, copied into `folder`."""
    for package in PACKAGES:
        shutil.copytree(ROOT / package, folder / package, ignore=shutil.ignore_patterns("__pycache__"))
    return folder


def replace(path: Path, old: str, new: str) -> None:
    """Replace a text that must occur exactly once."""
    text = path.read_text(encoding="utf-8")
    assert text.count(old) == 1, f"{path}: expected {old!r} once"
    path.write_text(text.replace(old, new), encoding="utf-8")


def python(sources: Path, *arguments: str) -> CompletedProcess[str]:
    """Python with the packages of `sources` before those installed."""
    return run(sys.executable, *arguments, cwd=sources, environment={"PYTHONPATH": str(sources)})


def try_to_build(sources: Path, folder: Path, *models: str) -> CompletedProcess[str]:
    """Packaging, run from `sources`."""
    return python(sources, "-m", "fmu_kit.packaging", str(folder), *(MODELS[model] for model in models))


def build(sources: Path, folder: Path, model: str) -> Path:
    """The FMU of a model, built from `sources` into `folder`."""
    done = try_to_build(sources, folder, model)
    assert done.returncode == 0, done.stderr
    return Path(done.stdout.strip())
