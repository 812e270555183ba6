"""How long a step takes inside a native FMU, without any master: `python -m benchmarks.native`.

CPU time of fmi2DoStep, called from C, the smallest of nine repetitions: of the controller with a sample in every step,
of the plant with one internal step in every step, each with both mathematics.
"""

import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import fmpy

from orchestration import subprocesses
from orchestration.quadrotor.wiring import MODELS

STEPS = 100_000
CASES = {"UnifiedController": ("law, 10 ms", 0.01), "QuadrotorPlant": ("plant, one internal step of 1 ms", 0.001)}


def built(folder: Path, mathematics: str) -> dict[str, Path]:
    """The FMUs with this mathematics, unpacked."""
    script = Path(__file__).parents[1] / "tests" / "fmus" / "scripts" / "build_native.py"
    subprocess.run(
        [sys.executable, script, mathematics, folder, *MODELS.values()],
        check=True, env=subprocesses.environment(), stdout=subprocess.DEVNULL,
    )  # fmt: skip
    return {name: Path(fmpy.extract(str(folder / f"{name}.fmu"), str(folder / name))) for name in MODELS}


def main() -> None:
    """Print a line for each."""
    with tempfile.TemporaryDirectory() as temporary:
        program = Path(temporary, "steps")
        source = Path(__file__).with_name("steps.c")
        subprocess.run([shutil.which("cc") or "cc", "-O2", source, "-o", program, "-ldl"], check=True)
        for mathematics in ("own", "libm"):
            folders = built(Path(temporary, mathematics), mathematics)
            for name, (what, h) in CASES.items():
                description = fmpy.read_model_description(str(folders[name]))
                library = folders[name] / "binaries" / fmpy.platform / f"{name}.so"
                command = [program, library, description.guid, repr(h), str(STEPS)]
                taken = subprocess.run(command, check=True, capture_output=True, text=True).stdout.strip()
                print(f"{what}, {mathematics} mathematics: {taken} us a step")


if __name__ == "__main__":
    main()
