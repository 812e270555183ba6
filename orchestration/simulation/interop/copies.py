"""Traced copies of any FMUs, which record their inputs and steps.

A copy has a library in front of the FMU's own, which forwards every call: `recorder.c`.
"""

import functools
import os
import re
import subprocess
import uuid
import zipfile
from pathlib import Path

from fmu_kit.archive import write_archive
from fmu_kit.loader import PLATFORM, compiler
from fmu_kit.scratch import temporary_folder
from orchestration.components.fmi.read_description import Kind, Model, read_model
from orchestration.foundation.basics.errors import QuadcosimError, UsageError
from orchestration.simulation.interop.assignment import Ports

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
        raise UsageError(f"{fmu}: FMI {model.description.fmiVersion}; expected FMI 2.0 to trace it in other masters")
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
