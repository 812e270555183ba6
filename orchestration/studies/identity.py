"""What a run and a store are identified by: content, sources and versions, never where a file lies or its age."""

import ast
import dataclasses
import functools
import hashlib
import importlib.metadata
import json
import platform
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from orchestration.quadrotor import translation
from orchestration.scenario import Scenario
from orchestration.studies.study import Fmus, Study

ROOTS = ("orchestration.simulation", "orchestration.studies.worker")
"""Where the code that flies begins."""
QUADROTOR = Path(translation.__file__).with_name("system.toml")
"""What every scenario is a change of"""
_ASIDE = ("orchestration.fmus", "orchestration.tables", "orchestration.studies.store")
"""What finds FMUs and keeps results; it is imported there and changes no bit of them."""
_PACKAGES = ("orchestration", "fmu_kit")
_FEATURES = ("fma", "fma4", "avx2", "avx512f")
"""of a processor, by which the C library and numpy choose among their mathematical functions"""


@functools.cache
def versions() -> dict[str, str]:
    """The software that a run's bits depend on, the sources on the flight's path by their hash."""
    packages = {name: importlib.metadata.version(name) for name in ("quadcosim", "numpy", "fmpy")}
    return {**packages, "sources": sources_hash(flight_sources())}


def flight_sources() -> dict[str, Path]:
    """The modules of this project that the code that flies imports, directly or not, by name."""
    found: dict[str, Path] = {}
    waiting = list(ROOTS)
    while waiting:
        name = waiting.pop()
        if name in found or name in _ASIDE or (path := _source(name)) is None:
            continue
        found[name] = path
        for node in ast.walk(ast.parse(path.read_bytes())):
            if isinstance(node, ast.ImportFrom) and node.module:
                waiting += [node.module, *(f"{node.module}.{alias.name}" for alias in node.names)]
            elif isinstance(node, ast.Import):
                waiting += [alias.name for alias in node.names]
    found[QUADROTOR.name] = QUADROTOR
    return found


def sources_hash(sources: Mapping[str, Path]) -> str:
    """One hash of the content of all modules."""
    digest = hashlib.sha256()
    for name, path in sorted(sources.items()):
        digest.update(f"{name}\0".encode() + hashlib.sha256(path.read_bytes()).digest())
    return digest.hexdigest()


def _source(name: str) -> Path | None:
    """The file of a module of this project; None for anything else."""
    package, *parts = name.split(".")
    if package not in _PACKAGES or not parts:
        return None
    path = Path(__file__).resolve().parents[2].joinpath(package, *parts).with_suffix(".py")
    return path if path.is_file() else None  # a name that is imported from a module has none


@functools.cache
def machine() -> str:
    """The kind of this machine: flights on different kinds may differ in the last bit."""
    libc = " ".join(platform.libc_ver()) or platform.system()
    features = " ".join(name for name in _FEATURES if name in _processor_flags())
    return f"Python {platform.python_version()}, {libc}, {platform.machine()} {features}".rstrip()


def _processor_flags() -> list[str]:
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        return []
    return next((line.partition(":")[2].split() for line in lines if line.startswith(("flags", "Features"))), [])


def reference_content(scenario: Scenario) -> bytes | None:
    """The reference file of a scenario; None if it has none."""
    return None if scenario.reference.file is None else scenario.reference.file.read_bytes()


def run_key(scenario: Scenario, fmus: Fmus, reference: bytes | None) -> str:
    """The hash of everything that determines a run.

    A parameter that has the value with which its FMU starts counts as not given.
    """
    content: dict[str, Any] = dataclasses.asdict(scenario)
    content.pop("model_mismatch")  # says something of the run, and changes none
    for side in ("plant", "controller"):
        given = content.pop(side)["parameters"]
        content[side] = {name: v for name, v in given.items() if v != fmus.starts.get(f"{side}.{name}")}
    content["reference"] = None if reference is None else hashlib.sha256(reference).hexdigest()
    content |= {"fmus": fmus.hashes, "versions": versions()}
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()


def study_parts(study: Study) -> dict[str, str]:
    """What a study file says of the runs, part by part, so that a difference can be named."""
    base = dataclasses.asdict(study.base)
    reference = reference_content(study.base)
    parts: dict[str, Any] = {
        "reference": None if reference is None else hashlib.sha256(reference).hexdigest(),
        **{f"timing.{key}": value for key, value in base["timing"].items()},
        **{f"{side}.{name}": v for side in ("controller", "plant") for name, v in base[side]["parameters"].items()},
        **{key: base[key] for key in ("stop_time", "seed", "record")},
    }
    return {name: json.dumps(value, sort_keys=True) for name, value in parts.items()}


def design_parts(study: Study) -> dict[str, str]:
    """What a study file says of its design; this may change, for rows are found by their keys."""
    sampled = any(axis.values is None for axis in study.axes)
    parts: dict[str, Any] = {
        "axes": [axis.name for axis in study.axes],
        "design": [study.method, study.samples, study.design_seed] if sampled else None,
        "vary_seed": study.vary_seed,
        **{f"axis {axis.name}": dataclasses.asdict(axis) for axis in study.axes},
    }
    return {name: json.dumps(value, sort_keys=True) for name, value in parts.items()}


def place_parts(fmus: Fmus) -> dict[str, str]:
    """What the rows of a store came from beside the study file."""
    return {
        **{f"FMU of the {side}": digest for side, digest in fmus.hashes.items()},
        **{f"version of {name}": version for name, version in versions().items()},
        "machine": machine(),
    }


def difference(before: Mapping[str, str], now: Mapping[str, str]) -> str:
    """What changed, in a few words; empty if nothing did."""
    differing = [name for name in sorted({*before, *now}) if before.get(name) != now.get(name)]
    told = [f"{n} was {_short(before.get(n))}, is {_short(now.get(n))}" for n in differing[:_MOST]]
    more = f"; and {len(differing) - _MOST} more" if len(differing) > _MOST else ""
    return "; ".join(told) + more


_MOST, _LONGEST = 3, 60


def _short(text: str | None) -> str:
    if text is None:
        return "absent"
    return text if len(text) <= _LONGEST else f"{text[: _LONGEST - 3]}..."
