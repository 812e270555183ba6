"""The resources of the controller on a microcontroller: `python -m benchmarks.embedded [--page PAGE]`.

Sizes are those of the compiled object; the stack is the frames along the deepest path of calls. Instructions, not
cycles, are counted under QEMU, in a flight of 10 s with the plant. With `--page` the table is written there.
"""

import argparse
import statistics
import subprocess
import tempfile
from dataclasses import replace
from pathlib import Path

from benchmarks import stack
from benchmarks.mathematics import table
from docs.pages import fill
from fmu_kit.bundle import Target
from fmu_kit.compiler.pack.embedded_files import write
from fmu_kit.variants import Value, Variant
from orchestration.components.building.models import MODELS
from tests.fmu_kit.compiler.compiled import HERE as BOARD_FILES
from tests.fmu_kit.compiler.embedded import ARM, BOARDS, M4F, M7, QEMU, on_cortex_m, rows_of, to_note

HERE = Path(__file__).parent
OPTIONS = ("-std=c99", "-fno-math-errno")
FLIGHT = ("-DSTEPS=3000", "-DH=0.01", "-DSAMPLE_PERIOD=0")
WITHOUT_TEXTS = "-DUNIFIEDCONTROLLER_NO_TEXTS"
OFF: dict[str, Value] = {
    "frame": "ned",
    "discretisation": "explicit",
    "prediction": 0.0,
    "gain_scaling": "absolute",
    "hold_period": 0.0,
    "weight": 1.0,
    "stages": 3,
}
FIXED: dict[str, dict[str, Value]] = {
    "nothing": {},
    "no redesign, no prediction": OFF,
    "`discretisation = mean`, `hold_period = 0.02`": {**OFF, "discretisation": "mean", "hold_period": 0.02},
}
"""Fixed values of the controller, by description."""
MACHINES = {"M4F": M4F, "M7": M7}


def size_of(source: Path, folder: Path, *flags: str) -> tuple[int, int]:
    """The size of code and constants of a source, and its deepest stack [bytes]."""
    compiled = folder / "size.o"
    subprocess.run([ARM, *OPTIONS, *stack.OPTIONS, *flags, "-c", str(source), "-o", str(compiled)], check=True)
    done = subprocess.run(["arm-none-eabi-size", str(compiled)], check=True, capture_output=True, text=True)
    return int(done.stdout.splitlines()[1].split()[0]), max(
        stack.deepest(compiled.with_suffix(".ci").read_text()).values()
    )


def variants_table(folder: Path) -> str:
    """The table of text and stack of the controller on an M4F at -O2, by fixed values."""
    rows = []
    for words, values in FIXED.items():
        for precision in ("double", "single"):
            fixed = replace(Target.parse(MODELS["UnifiedController"]), variant=Variant.of("Law", values))
            source = write(fixed, folder / precision, single=precision == "single")
            text, depth = size_of(source, folder, *M4F, "-O2")
            bare, _ = size_of(source, folder, *M4F, "-O2", "-DLAW_NO_TEXTS")
            rows.append([words, precision, *(f"{n:,}" for n in (text, bare, depth))])
    return table(["fixed", "precision", "text [B]", "without words [B]", "stack [B]"], rows)


def count_instructions(
    sources: list[Path], folder: Path, machine: tuple[str, ...], *flags: str
) -> tuple[int, list[int]]:
    """Bytes of the instance, and the instructions of each step of a flight with the plant.

    `sources` are of the controller and of the plant; raises `subprocess.CalledProcessError` where a step fails.
    """
    board_files = [str(BOARD_FILES / "cortex_m.c"), "-T", str(BOARD_FILES / "cortex_m.ld"), "--specs=rdimon.specs"]
    places = [f"-I{source.parent}" for source in sources]
    program = [str(HERE / "embedded.c"), *map(str, sources), "-lm", "-o", str(folder / "run")]
    subprocess.run([ARM, *OPTIONS, *machine, *flags, *places, *board_files, *program], check=True)
    qemu = [QEMU, "-M", BOARDS[machine], "-display", "none", "-icount", "shift=6"]
    options = ["-semihosting-config", "enable=on,target=native", "-kernel", str(folder / "run")]
    done = subprocess.run([*qemu, *options], check=True, stdout=subprocess.PIPE, text=True, timeout=300)
    size, *counts = (int(word) for word in done.stdout.split())
    return size, counts


def differences(double: Path, single: Path, plant: Path) -> str:
    """The table of differences between flights of both precisions, over 30 s of the built-in trajectory at 100 Hz."""
    names = to_note(double, plant, plant.parent)
    double_rows, single_rows = (
        rows_of(on_cortex_m(M4F, "embedded_flight.c", [source, plant], plant.parent, *FLIGHT))
        for source in (double, single)
    )
    far = dict(zip(names, abs(double_rows - single_rows).max(axis=0)))
    rows = []
    for group, unit in {"p.position": "m", "p.velocity": "m/s", "c.thrust": "N", "c.torque": "N·m"}.items():
        largest = max(value for name, value in far.items() if name in (group, *(f"{group}.{axis}" for axis in "xyz")))
        rows.append([f"{group[2:]} [{unit}]", f"{largest:.1e}"])
    return table(["", "largest difference"], rows)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--page", type=Path)
    page = parser.parse_args().page
    controller, plant = (Target.parse(MODELS[name]) for name in ("UnifiedController", "QuadrotorPlant"))
    rows = []
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        plant_source = write(plant, folder / "plant")
        for precision in ("double", "single"):
            source = write(controller, folder / precision, single=precision == "single")
            for machine, flags in MACHINES.items():
                for optimised in ("-O2", "-Os"):
                    size, counts = count_instructions([source, plant_source], folder, flags, optimised)
                    text, depth = size_of(source, folder, *flags, optimised)
                    bare, _ = size_of(source, folder, *flags, optimised, WITHOUT_TEXTS)
                    numbers = (text, bare, size, depth, round(statistics.mean(counts)), max(counts))
                    rows.append([precision, machine, f"`{optimised}`", *(f"{n:,}" for n in numbers)])
        double, single = (folder / precision / "UnifiedController.c" for precision in ("double", "single"))
        far = differences(double, single, plant_source)
        fixed = variants_table(folder)
    heads = ["precision", "machine", "", "text [B]", "without words [B]", "instance [B]", "stack [B]"]
    found = table([*heads, "instructions a step", "most"], rows)
    version = subprocess.run([ARM, "--version"], check=True, capture_output=True, text=True).stdout.splitlines()[0]
    print(found, version, fixed, far, sep="\n\n")
    if page is not None:
        fill(page, {"sizes": f"{found}\n\n`{version}`", "single": far, "fixed": fixed})


if __name__ == "__main__":
    main()
