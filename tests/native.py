"""Slaves written out as C: the flight of them, and what it has in common with that of the same slaves in Python."""

import hashlib
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from fmu_kit.archive import read_source_hash
from fmu_kit.bundle import Target
from fmu_kit.compiler.pack.c_compiler import Mathematics
from orchestration.components.building import builder
from orchestration.simulation.runs.result import Result
from quadcosim import Scenario
from tests.fmus.process import run
from tests.places import ROOT

KEPT = ROOT / ".cache" / "built_for_tests"

NATIVE = Scenario().with_fmus(plant="native/QuadrotorPlant", controller="native/UnifiedController")
"""The paper's flight by the FMUs that fly fastest, with the same rows as those with Python inside."""


def native(**fields: Any) -> Scenario:
    """The same with other fields."""
    return replace(NATIVE, **fields)


def kept(*what: str) -> Path:
    """The folder of what is built for tests alone, shared by all processes and kept for later runs."""
    return KEPT / hashlib.sha256(repr(what).encode()).hexdigest()[:16]


def library(compiler: str, source: Path, *flags: str) -> bytes:
    """One source in C as a shared library, kept for all processes and later runs while what makes it is the same."""
    by = Path(compiler).resolve()
    path = kept("library", f"{by} {by.stat().st_mtime_ns}", source.read_text(encoding="utf-8"), *flags) / "library"
    if not path.is_file():
        path.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=path.parent) as folder:
            made = Path(folder) / path.name
            options = ("-shared", "-fPIC", "-O1", "-w")
            subprocess.run([compiler, *options, *flags, str(source), "-o", str(made), "-lm"], check=True)
            os.replace(made, path)  # of several processes each makes the same
    return path.read_bytes()


def natives(targets: Iterable[Target], mathematics: Mathematics, folder: Path | None = None) -> dict[str, Path]:
    """FMUs of slaves without Python inside, by model name; the slaves are of one place.

    Without a folder they are kept for all processes and later runs, and built again when their sources change.
    """
    known = list(targets)
    root = known[0].root
    where = folder or kept(mathematics, str(root))
    paths = {target.model: where / f"{target.model}.fmu" for target in known}
    names = [
        f"{target.module}:{target.model}"
        for target in known
        if folder or read_source_hash(paths[target.model]) != builder.NATIVE.source_hash(target)
    ]
    if names:
        place = () if root is None else ("--root", str(root))
        done = run(sys.executable, "-m", "tests.fmus.scripts.build_native", mathematics, str(where), *place, *names)
        assert done.returncode == 0, done.stderr
    return paths


def assert_the_same(one: Result, other: Result) -> None:
    """Everything that two flights have come to, to the last bit and letter."""
    assert one.columns == other.columns
    assert one.rows.shape == other.rows.shape
    differing = [name for name in one.columns if one.signals[name].tobytes() != other.signals[name].tobytes()]
    assert differing == []
    assert one.events == other.events
    assert repr(one.metrics) == repr(other.metrics)
    assert (one.divergence, one.warnings) == (other.divergence, other.warnings)


def assert_near(one: Result, other: Result, tolerance: float) -> None:
    """All values within a tolerance [1], relative to the largest of their signal; the same events."""
    assert one.columns == other.columns
    assert one.rows.shape == other.rows.shape
    largest = np.abs(one.rows).max(axis=0)
    furthest = np.abs(one.rows - other.rows).max(axis=0)
    far = {name: far for name, far, size in zip(one.columns, furthest, largest) if far > tolerance * max(size, 1.0)}
    assert far == {}
    assert one.events == other.events
