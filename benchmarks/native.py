"""The time of a step inside a native FMU, without a master: `python -m benchmarks.native`.

CPU time of fmi2DoStep, called from C, the smallest of nine repetitions: of the controller with a sample in every step,
of the plant with one internal step in every step, each with both mathematics. Then a step in SIMD lanes, compiled for
this processor from the sources in the FMU, of all variables: with the parameters for which there is a straight line.
"""

import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import fmpy

from fmu_kit.bundle import Target
from fmu_kit.compiler.pack.lanes import compiled_lanes
from fmu_kit.packaging import slave_class
from orchestration.components.building.models import MODELS
from orchestration.foundation.processes import subprocesses

STEPS = 100_000
LANES = (1, 4, 8, 16)
CASES = {"UnifiedController": ("law, 10 ms", 0.01), "QuadrotorPlant": ("plant, one internal step of 1 ms", 0.001)}


def build_fmus(folder: Path, mathematics: str) -> dict[str, Path]:
    """The FMUs with this mathematics, unpacked."""
    script = Path(__file__).parents[1] / "tests" / "fmus" / "scripts" / "build_native.py"
    subprocess.run(
        [sys.executable, script, mathematics, folder, *MODELS.values()],
        check=True, env=subprocesses.environment(), stdout=subprocess.DEVNULL,
    )  # fmt: skip
    return {name: Path(fmpy.extract(str(folder / f"{name}.fmu"), str(folder / name))) for name in MODELS}


def program(name: str, folder: Path) -> Path:
    """A program in C beside this file, compiled."""
    path = folder / name
    source = Path(__file__).with_name(f"{name}.c")
    subprocess.run([shutil.which("cc") or "cc", "-O2", source, "-o", path, "-ldl"], check=True)
    return path


def usual_values(name: str, folder: Path) -> list[str]:
    """The parameters that a model usually has, other than at the start: VALUE_REFERENCE=VALUE."""
    variables = fmpy.read_model_description(str(folder)).modelVariables
    references = {variable.name: variable.valueReference for variable in variables}
    usual = slave_class(Target.parse(MODELS[name])).usual_parameters
    return [f"{references[parameter]}={float(value)!r}" for parameter, value in usual.items()]


def output_of(*command: str | Path) -> str:
    """What a program prints."""
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout.strip()


def main() -> None:
    """Print a line for each."""
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        alone, in_lanes = program("steps", folder), program("lane_steps", folder)
        for mathematics in ("own", "libm"):
            folders = build_fmus(folder / mathematics, mathematics)
            for name, (what, h) in CASES.items():
                description = fmpy.read_model_description(str(folders[name]))
                library = folders[name] / "binaries" / fmpy.platform / f"{name}.so"
                taken = output_of(alone, library, description.guid, repr(h), str(STEPS))
                print(f"{what}, {mathematics} mathematics: {taken} us a step")
        for name, (what, h) in CASES.items():
            sources = {file.name: file.read_bytes() for file in (folder / "own" / name / "sources").iterdir()}
            usual = usual_values(name, folder / "own" / name)
            for lanes in LANES:
                library = folder / f"{name}_{lanes}.so"
                library.write_bytes(compiled_lanes(sources, lanes))
                taken = output_of(in_lanes, library, repr(h), str(STEPS // lanes), *usual)
                print(f"{what}, {lanes} lanes: {taken} ns a step and lane")


if __name__ == "__main__":
    main()
