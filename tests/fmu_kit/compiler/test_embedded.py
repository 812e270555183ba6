"""Slaves exported for a microcontroller give the flights of their native FMUs, on emulated boards and here."""

import functools
import re
import shutil
import zlib
from pathlib import Path

import numpy as np
import pytest

from fmu_kit.bundle import Target
from fmu_kit.compiler.emit.embedded_functions import single_number
from fmu_kit.compiler.pack.embedded_files import write
from orchestration.components.building import builder, fmus
from orchestration.components.building.models import MODELS
from tests.commands import Main
from tests.extent import sample, tries
from tests.fmu_kit.compiler.embedded import (
    ARM,
    M4F,
    M7,
    assert_its_header_is_kept,
    calls,
    declared,
    defined,
    elsewhere,
    made,
    on_cortex_m,
    on_this_machine,
    rows_of,
    to_note,
)
from tests.fmus.expected import COMMAND
from tests.fmus.instance import Instance
from tests.fmus.loop import MOTION, Loop
from tests.fmus.making import PAIR
from tests.native import kept

H, STEPS = 0.01, tries(500, sampled=200)
FLOWN = {"mass": 1.1, "wind.amplitude.x": 0.5, "initial.position.x": 0.3}
"""Of the plant, as embedded_flight.c has it."""
TOLERANCES = {
    "position": 1e-5,
    "velocity": 5e-5,
    "quaternion": 5e-6,
    "angular_velocity": 5e-4,
    "thrust": 5e-4,
    "torque": 5e-3,
}
"""Of a flight in single precision [m, m/s, 1, rad/s, N, N.m]."""


@pytest.fixture(scope="module")
def exported(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """The sources of both sides, and of the controller in single precision; kept while what makes them is the same."""
    targets = {name: Target.parse(text) for name, text in PAIR.items()}
    asked = {
        **{name: (target, False) for name, target in targets.items()},
        "single": (targets["UnifiedController"], True),
    }
    found = {}
    for name, (target, single) in asked.items():
        folder = kept("exported", name, builder.NATIVE.source_hash(target))
        if not (folder / f"{target.model}.c").is_file():
            write(target, folder, single=single)
        own = shutil.copytree(folder, tmp_path_factory.mktemp(name) / "own")  # where it is compiled
        found[name] = own / f"{target.model}.c"
    return found


def native(name: str) -> Instance:
    """One of this project's FMUs without Python inside."""
    return Instance(fmus.locate(f"{builder.NATIVE.folder}/{name}"))


@pytest.fixture(scope="module")
def simulated() -> dict[str, list[float]]:
    """All variables after each step of the native FMUs."""
    sides = {"c": native("UnifiedController"), "p": native("QuadrotorPlant")}
    rows: dict[str, list[float]] = {f"{side}.{name}": [] for side in sides for name in sides[side].variables}
    with sides["c"] as controller, sides["p"] as plant:
        loop = Loop(controller, plant)
        plant.initialise(FLOWN)
        controller.initialise(dict(zip(MOTION, plant.get(*MOTION), strict=True)))
        for k in range(STEPS):
            loop.measure()
            controller.step(k * H, H)
            loop.command()
            plant.step(k * H, H)
            for side, instance in sides.items():
                for name, value in instance.values().items():
                    rows[f"{side}.{name}"].append(float(value))
    return rows


FOR_SOLVERS = ("p.der(", "p.channels.")
"""What native FMUs have for the solvers of others"""
RUNS = {
    "here": on_this_machine,
    "by_clang": functools.partial(on_this_machine, by="clang"),
    "aarch64": functools.partial(elsewhere, "qemu-aarch64", "aarch64-linux-gnu-gcc"),
    "riscv64": functools.partial(elsewhere, "qemu-riscv64", "riscv64-linux-gnu-gcc"),
    "win64": functools.partial(elsewhere, "wine", "x86_64-w64-mingw32-gcc"),
    "cortex_m4f": functools.partial(on_cortex_m, M4F),
    "cortex_m7": functools.partial(on_cortex_m, M7),
}
FLAGS = (f"-DSTEPS={STEPS}", f"-DH={H}")


@pytest.mark.parametrize("where", sample([*RUNS], 1))
def test_in_double_precision_every_variable_is_that_of_the_native_fmu_to_the_bit(
    where: str, exported: dict[str, Path], simulated: dict[str, list[float]], tmp_path: Path
) -> None:
    sides = [exported["UnifiedController"], exported["QuadrotorPlant"]]
    names = to_note(sides[0], sides[1], tmp_path)
    lines = RUNS[where]("embedded_flight.c", sides, tmp_path, *FLAGS, f"-DSAMPLE_PERIOD={H}")
    expected = np.array([simulated[name] for name in names]).T.copy()
    assert sorted(names) == sorted(name for name in simulated if not name.startswith(FOR_SOLVERS))
    assert rows_of(lines).tobytes() == expected[99::100].tobytes()
    assert int(lines[-1], 16) == zlib.crc32(expected.tobytes())


@pytest.mark.parametrize("where", ["here", "cortex_m4f"])
def test_in_single_precision_the_flight_is_near(
    where: str, exported: dict[str, Path], simulated: dict[str, list[float]], tmp_path: Path
) -> None:
    sides = [exported["single"], exported["QuadrotorPlant"]]
    names = to_note(sides[0], sides[1], tmp_path)
    rows = rows_of(RUNS[where]("embedded_flight.c", sides, tmp_path, *FLAGS, "-DSAMPLE_PERIOD=0"))
    for name in (*(f"p.{name}" for name in MOTION), *(f"c.{name}" for name in COMMAND)):
        far = np.abs(rows[:, names.index(name)] - simulated[name][99::100]).max()
        assert far < TOLERANCES[name[2:].partition(".")[0]], name
    assert rows[-1, names.index("c.sample_count")] == STEPS


def test_in_single_precision_the_redesign_finds_the_commands_of_double(
    exported: dict[str, Path], tmp_path: Path
) -> None:
    single, double = (
        on_this_machine("embedded_match.c", [exported[name]], tmp_path, f"-Dq_number={number}")
        for name, number in (("single", "float"), ("UnifiedController", "double"))
    )
    found, expected = (np.array([list(map(float, line.split())) for line in lines]) for lines in (single, double))
    assert not expected[:, 0].any()
    np.testing.assert_allclose(found, expected, rtol=1e-3, atol=1e-3)


def test_in_single_precision_a_clock_of_its_own_misses_samples(exported: dict[str, Path], tmp_path: Path) -> None:
    sides = [exported["single"], exported["QuadrotorPlant"]]
    names = to_note(sides[0], sides[1], tmp_path)
    flags = (f"-DSTEPS={STEPS}", "-DH=0.004", "-DSAMPLE_PERIOD=0.004")
    rows = rows_of(on_this_machine("embedded_flight.c", sides, tmp_path, *flags))
    assert STEPS / 2 < rows[-1, names.index("c.sample_count")] < 0.85 * STEPS  # as the page says


def test_what_cannot_be_is_said_by_a_status_with_words_and_the_outputs_stay(
    exported: dict[str, Path], tmp_path: Path
) -> None:
    source = exported["UnifiedController"]
    good = "0 no error"
    assert on_this_machine("embedded_refusals.c", [source], tmp_path) == [
        "1 UnifiedController_step before start: expected UnifiedController_start first",
        *["1 mass = ...: expected a finite value > 0"] * 2,
        good,
        "1 UnifiedController_start after start: expected UnifiedController_init first",
        good,
        "1 communicationStepSize = ...: expected a positive number of seconds",
        good,
        *["1 position.x = ...: expected a finite value"] * 2,
        "1",
        good,
        "1 energy = ...: expected a finite value",
        good,
        good,
        "1 mass = ...: expected a finite value > 0",
        good,
        "0",
        good,
        "1",
        *["1 no such status"] * 2,
    ]


@pytest.mark.parametrize("name", PAIR)
def test_in_double_precision_nothing_is_called_but_what_fills_memory(name: str, exported: dict[str, Path]) -> None:
    assert calls(made(exported[name], "cc")) <= {"memset", "memcpy", "_GLOBAL_OFFSET_TABLE_"}
    there = calls(made(exported[name], ARM, *M4F), "arm-none-eabi-nm")
    assert {each for each in there if not each.startswith("__aeabi_")} <= {"memset"}


def test_in_single_precision_nothing_is_computed_with_doubles(exported: dict[str, Path]) -> None:
    there = calls(made(exported["single"], ARM, *M4F), "arm-none-eabi-nm")
    assert there == {"memset", "atan2f", "ceilf", "cosf", "floorf", "powf", "sinf", "tanhf"}


def test_without_texts_there_are_none(exported: dict[str, Path]) -> None:
    source = exported["QuadrotorPlant"]
    assert b"expected a finite value" in made(source, "cc").read_bytes()
    assert b"expected a finite value" not in made(source, "cc", "-DQUADROTORPLANT_NO_TEXTS", "-O0").read_bytes()


def test_numbers_too_large_or_too_small_for_single_precision_are_its_largest_and_smallest() -> None:
    texts = [single_number(value) for value in (0.1, -2.0, 1e100, -1e100, 1e-300, 0.0, -0.0, 16777217.0)]
    assert texts == [
        "0.1f",
        "-2.0f",
        "3.4028235e+38f",
        "-3.4028235e+38f",
        "1.1754944e-38f",
        "0.0f",
        "-0.0f",
        "16777216.0f",
    ]


def test_the_command_writes_one_slave_of_a_folder_and_says_in_one_line_what_is_none(main: Main, tmp_path: Path) -> None:
    done = main("export-c", "examples/dc_servo/PidController", "--out", tmp_path / "out", "--single")
    assert done.stdout.splitlines() == [str(tmp_path / "out" / f"PidController.{end}") for end in "hc"]
    assert_its_header_is_kept(tmp_path / "out" / "PidController.c")
    for asked, words in (
        ("Controller", f"Controller: expected {' or '.join(MODELS)}, a folder"),
        (
            "examples/dc_servo/Pid",
            "examples/dc_servo/Pid: expected examples/dc_servo/PidController or examples/dc_servo/Servo, or ",
        ),
    ):
        refused = main("export-c", asked, "--out", tmp_path, code=2)
        assert refused.stderr.startswith(f"quadcosim: {words}")
        assert refused.stderr.count("\n") == 1


def test_the_program_of_the_page_is_good_c(exported: dict[str, Path], tmp_path: Path) -> None:
    page = Path("docs/embedded.md").read_text("utf-8")
    (program,) = re.findall(r"```c\n(.*?)```", page, re.DOTALL)
    source = exported["UnifiedController"].with_name("main.c")
    source.write_text(program)
    program_object = made(source, "cc")
    assert defined(program_object) == {"main"}
    used = {f"UnifiedController_{name}" for name in ("init", "start", "step", "error")}
    assert calls(program_object) & declared(exported["UnifiedController"].with_suffix(".h")) == used


@pytest.mark.parametrize("name", ["Branches", "Words"])
def test_a_slave_with_much_to_say_is_written_without_a_warning_of_the_compiler(name: str, tmp_path: Path) -> None:
    target = Target.parse(f"tests.fmu_kit.compiler.probes:{name}", Path().resolve())
    for single, flags in ((False, ()), (True, ("-O1",))):
        assert_its_header_is_kept(write(target, tmp_path, single=single), *flags)


def test_of_values_that_are_fixed_and_what_they_turn_off_there_is_nothing_left(main: Main, tmp_path: Path) -> None:
    """The paper's law alone: no redesign, no pending commands; it compiles without warnings."""
    off = ("discretisation=explicit", "prediction=0", "gain_scaling=absolute", "hold_period=0", "weight=1", "stages=3")
    main("export-c", "--name", "PaperLaw", *(part for each in off for part in ("--set", each)), "--out", tmp_path)
    header, source = ((tmp_path / f"PaperLaw.{ending}").read_text("utf-8") for ending in ("h", "c"))
    assert not re.search(r"double (discretisation|prediction|gain_scaling|pending|hold_period|stages)", header)
    assert not re.search(r"model_(matched|predicted|redesign|discretised|remember)\b", source)
    made(tmp_path / "PaperLaw.c", "cc")
    assert len(source) < 150_000
