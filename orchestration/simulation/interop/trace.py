"""How a tool steps the FMUs, from the logs of traced copies, which record their inputs and steps.

A copy has a library in front of the FMU's own, which forwards every call: `recorder.c`.
"""

import functools
import json
import os
import re
import subprocess
import uuid
import zipfile
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import Any

from fmu_kit.archive import write_archive
from fmu_kit.loader import PLATFORM, compiler
from fmu_kit.scratch import temporary_folder
from orchestration.components.fmi.instance import number_of
from orchestration.components.fmi.read_description import Kind, Model, read_model
from orchestration.foundation.basics.errors import QuadcosimError, UsageError
from orchestration.simulation.interop.assignment import AssignedLoop, Ports


@dataclass(frozen=True, kw_only=True)
class Trace:
    """How a tool stepped the FMUs."""

    order: str
    """gauss-seidel: the components step one after the other, each with the newest outputs of those before it; jacobi:
    all step with the outputs of the step before; alone: only a part of the loop was run; other: none of these"""
    initial_inputs: dict[str, tuple[float, ...]]
    """The values at the connected inputs of each component when its initialisation ended."""
    first_inputs: dict[str, tuple[float, ...]]
    """The values at the connected inputs of each component when its first step began."""
    first_exchange: dict[str, str]
    """The origin of these, for each component: exchanged (outputs of the others), start values or zeros."""
    steps: int
    """Number of steps that the last component of the loop took."""
    drift: float
    """The largest distance of a communication point from a multiple of the step [s]."""
    end: float
    """The time at which the last step ended [s]."""


def read_trace(folder: Path, components: Mapping[str, Path], loop: AssignedLoop, step: float) -> Trace:
    """The trace in the logs of `components`, FMUs by name; raises `QuadcosimError` if a component took no step."""
    starts, steps = {}, {}
    for component in components:
        log = log_of(component, folder)
        lines = log.read_text(encoding="utf-8").splitlines() if log.is_file() else []
        if len(lines) < 2:
            raise QuadcosimError(f"{component}: the tool did not step it; expected at least one step in {log}")
        starts[component], *steps[component] = map(json.loads, lines)
    exact = Fraction(repr(step))
    last = steps[next(name for name in reversed(list(loop.ports)) if name in steps)]
    return Trace(
        order=_order(steps, loop),
        initial_inputs={component: tuple(start["inputs"]) for component, start in starts.items()},
        first_inputs={component: tuple(found[0]["inputs"]) for component, found in steps.items()},
        first_exchange={
            name: _first_exchange(name, components[name], loop, starts, steps)
            for name in components
            if loop.ports[name].inputs
        },
        steps=len(last),
        drift=max(abs(line["t"] - float(k * exact)) for k, line in enumerate(last)),
        end=last[-1]["t"] + last[-1]["h"],
    )


def _order(steps: Mapping[str, list[dict[str, Any]]], loop: AssignedLoop) -> str:
    """The order of exchange: the step whose outputs were the inputs of each step after the first."""
    if set(steps) != set(loop.ports) or len(steps) < 2:
        return "alone"
    places = {name: i for i, name in enumerate(loop.ports)}
    old, new = True, True
    for component in steps:
        for sender, values, before, now in _exchanged(component, steps, loop):
            old &= values == before
            new &= values == (now if places[sender] < places[component] else before)
    return "gauss-seidel" if new else "jacobi" if old else "other"


def _exchanged(
    component: str, steps: Mapping[str, list[dict[str, Any]]], loop: AssignedLoop
) -> Iterator[tuple[str, list[float], list[float], list[float]]]:
    """For each connected input: its sender, its values from the second step on, the outputs of the step before and of
    the same step.
    """
    for i, (sender, output) in enumerate(loop.feeding(component).values()):
        place = loop.ports[sender].outputs.index(output)
        outputs = [line["outputs"][place] for line in steps[sender]]
        values = [line["inputs"][i] for line in steps[component][1:]]
        yield sender, values, outputs[: len(values)], outputs[1 : len(values) + 1]


def _first_exchange(
    component: str,
    fmu: Path,
    loop: AssignedLoop,
    starts: Mapping[str, dict[str, Any]],
    steps: Mapping[str, list[dict[str, Any]]],
) -> str:
    """The origin of the connected inputs of `component` at its first step."""
    variables = read_model(fmu).variables
    inputs = steps[component][0]["inputs"]
    if inputs == [number_of(variables[name], variables[name].start or 0.0) for name in loop.ports[component].inputs]:
        return "start values"
    if not any(inputs):
        return "zeros"
    feeding = loop.feeding(component)
    if not all(sender in starts for sender, _ in feeding.values()):
        return "exchanged"
    for value, (sender, output) in zip(inputs, feeding.values(), strict=True):
        place = loop.ports[sender].outputs.index(output)
        if value not in (starts[sender]["outputs"][place], steps[sender][0]["outputs"][place]):
            return "other"
    return "exchanged"


SOURCE = Path(__file__).with_name("recorder.c")
_KINDS: dict[Kind, int] = {"Real": 0, "Integer": 1, "Enumeration": 1, "Boolean": 2}
"""Numbers of kinds as in `recorder.c`"""
_GUID = re.compile(rb"""(\sguid\s*=\s*)("[^"]*"|'[^']*')""")


def traced_copy(fmu: Path, component: str, ports: Ports, folder: Path) -> Path:
    """A copy of `fmu` in `folder` that records its steps in `log_of(component, folder)`.

    Raises `UsageError` as `expect_traceable` does, `QuadcosimError` if the compiler fails.
    """
    expect_traceable(fmu)
    model = read_model(fmu)
    with zipfile.ZipFile(fmu) as archive:
        files = {name: archive.read(name) for name in archive.namelist() if not name.endswith("/")}
    library = _library(model)
    own = f"own_{Path(library).name}"
    lines = [
        str(log_of(component, folder)),
        own,
        str(model.description.guid),
        f"{len(ports.inputs)} {len(ports.outputs)}",
    ]
    for name in (*ports.inputs, *ports.outputs):
        variable = model.variables[name]
        lines.append(f"{_KINDS[variable.kind]} {variable.reference}")
    files[f"{PLATFORM}/{own}"] = files[library]
    files[library] = _recorder()
    files[library.removesuffix(".so") + ".record"] = "\n".join(lines).encode() + b"\n"
    guid = uuid.uuid5(uuid.NAMESPACE_OID, f"{component} {model.description.guid}")
    described = _GUID.sub(rb'\g<1>"%s"' % str(guid).encode(), files["modelDescription.xml"], count=1)
    files["modelDescription.xml"] = described
    copy = folder / f"{component}.fmu"
    write_archive(copy, files, first="modelDescription.xml")
    return copy


def log_of(component: str, folder: Path) -> Path:
    """The log of a traced copy: one JSON object for the end of initialisation, one for each step."""
    return folder / f"{component}.jsonl"


def expect_traceable(fmu: Path) -> None:
    """Raise `UsageError` for an FMU without a traced copy that other masters load here."""
    model = read_model(fmu)
    if model.version != 2:
        raise UsageError(
            f"{fmu}: FMI {model.description.fmiVersion}; expected FMI 2.0 to trace it in other masters; export it as "
            "FMI 2.0, or compare the CSVs of quadcosim run MODEL.fmu --output FILE and fmpy simulate, which take both"
        )
    if compiler() is None:
        raise UsageError(f"{fmu}: expected a C compiler called cc, on Linux (x86_64), to trace it in other masters")
    with zipfile.ZipFile(fmu) as archive:
        if _library(model) not in archive.namelist():
            raise UsageError(f"{fmu}: has no {_library(model)}; expected one to run it here")


def _library(model: Model) -> str:
    return f"{PLATFORM}/{model.description.coSimulation.modelIdentifier}.so"


@functools.cache
def _recorder() -> bytes:
    """The compiled library."""
    with temporary_folder() as folder:
        library = folder / "recorder.so"
        options = ("-std=gnu11", "-O2", "-fPIC", "-shared", "-fvisibility=hidden", str(SOURCE))
        command = [str(compiler()), *options, "-o", str(library), "-ldl"]
        environment = {**os.environ, "TMPDIR": str(folder)}
        done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
        if done.returncode != 0:
            lines = done.stderr.strip().splitlines() or ["no output"]
            raise QuadcosimError(f"{SOURCE.name}: {lines[0]}")
        return library.read_bytes()
