"""Slaves written out for a microcontroller fly as their native FMUs do, there and here."""

import struct
import zlib
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from fmu_kit.bundle import Target
from fmu_kit.native.embedded import write
from fmu_kit.native.embedded_code import single_number
from orchestration import fmus
from orchestration.quadrotor.wiring import MODELS
from tests.commands import Main
from tests.fmu_kit.native.embedded import ARM, calls, fields, made, on_cortex_m, on_this_machine
from tests.fmus.expected import COMMAND
from tests.fmus.instance import Instance
from tests.fmus.loop import MOTION, Loop

H, STEPS = 0.01, 500
FLOWN = {"mass": 1.1, "wind.amplitude.x": 0.5, "initial.position.x": 0.3}
"""Of the plant, as embedded_flight.c has it."""
TOLERANCES = {"position": 1e-5, "velocity": 5e-5, "quaternion": 5e-6, "thrust": 5e-4, "torque": 5e-3}
"""Of a flight in single precision [m, m/s, 1, N, N.m]."""
Rows = NDArray[np.float64]


@pytest.fixture(scope="module")
def exported(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """The sources of both sides, and of the controller in single precision."""
    double, single = tmp_path_factory.mktemp("double"), tmp_path_factory.mktemp("single")
    targets = {name: Target.parse(text) for name, text in MODELS.items()}
    written = {name: write(target, double) for name, target in targets.items()}
    return {**written, "single": write(targets["UnifiedController"], single, single=True)}


def native(name: str) -> Instance:
    """One of this project's FMUs without Python inside."""
    return Instance(fmus.locate(f"{fmus.NATIVE.folder}/{name}"))


@pytest.fixture(scope="module")
def flown() -> Rows:
    """All variables after each step of the native FMUs, those of the controller first."""
    rows = []
    with native("UnifiedController") as controller, native("QuadrotorPlant") as plant:
        loop = Loop(controller, plant)
        plant.initialise(FLOWN)
        controller.initialise(dict(zip(MOTION, plant.get(*MOTION), strict=True)))
        for k in range(STEPS):
            loop.measure()
            controller.step(k * H, H)
            loop.command()
            plant.step(k * H, H)
            rows.append([float(each.value(name)) for each in loop.both for name in each.variables])
    return np.array(rows)


def prepared(controller: Path, plant: Path, folder: Path) -> tuple[str, ...]:
    """Write down for embedded_flight.c what to note of both, in the order of the FMUs; the flags to compile it with."""
    noted = []
    for side, source in (("c", controller), ("p", plant)):
        by_name = fields(source.with_suffix(".h"))
        with native(source.stem) as instance:
            noted += [f"X({side}.{by_name[name]})" for name in instance.variables]
    (folder / "variables.h").write_text(f"#define EACH(X) {' '.join(noted)}\n")
    return f"-DSTEPS={STEPS}", f"-DSAMPLE_PERIOD={H if controller.parent == plant.parent else 0}"


def rows_of(lines: list[str]) -> Rows:
    """The rows that were printed in full, every hundredth."""
    return np.array([[struct.unpack(">d", bytes.fromhex(text))[0] for text in line.split()] for line in lines[:-1]])


RUNS = {"here": on_this_machine, "cortex_m4f": on_cortex_m}


@pytest.mark.parametrize("where", RUNS)
def test_in_double_precision_every_variable_is_that_of_the_native_fmu_to_the_bit(
    where: str, exported: dict[str, Path], flown: Rows, tmp_path: Path
) -> None:
    sides = [exported["UnifiedController"], exported["QuadrotorPlant"]]
    flags = prepared(*sides, tmp_path)
    lines = RUNS[where]("embedded_flight.c", sides, tmp_path, *flags)
    assert rows_of(lines).tobytes() == flown[99::100].tobytes()
    assert int(lines[-1], 16) == zlib.crc32(flown.tobytes())


@pytest.mark.parametrize("where", RUNS)
def test_in_single_precision_the_flight_is_near(
    where: str, exported: dict[str, Path], flown: Rows, tmp_path: Path
) -> None:
    sides = [exported["single"], exported["QuadrotorPlant"]]
    flags = prepared(*sides, tmp_path)
    rows = rows_of(RUNS[where]("embedded_flight.c", sides, tmp_path, *flags))
    with native("UnifiedController") as instance:
        names = list(instance.variables)
    for name in (*MOTION, *COMMAND):
        k = names.index(name)
        tolerance = TOLERANCES.get(name.partition(".")[0], 5e-4)
        assert np.abs(rows[:, k] - flown[99::100, k]).max() < tolerance, name
    assert rows[-1, names.index("sample_count")] == STEPS


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


@pytest.mark.parametrize("name", MODELS)
def test_in_double_precision_nothing_is_called_but_what_fills_memory(name: str, exported: dict[str, Path]) -> None:
    assert calls(made(exported[name], "cc")) <= {"memset", "memcpy", "_GLOBAL_OFFSET_TABLE_"}
    there = calls(made(exported[name], ARM), "arm-none-eabi-nm")
    assert {each for each in there if not each.startswith("__aeabi_")} <= {"memset"}


def test_in_single_precision_nothing_is_computed_with_doubles(exported: dict[str, Path]) -> None:
    there = calls(made(exported["single"], ARM), "arm-none-eabi-nm")
    assert there == {"memset", "ceilf", "cosf", "floorf", "powf", "sinf", "tanhf"}


def test_without_texts_there_are_none(exported: dict[str, Path]) -> None:
    source = exported["UnifiedController"]
    assert b"expected a finite value" in made(source, "cc").read_bytes()
    assert b"expected a finite value" not in made(source, "cc", "-DUNIFIEDCONTROLLER_NO_TEXTS").read_bytes()


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
    assert made(tmp_path / "out" / "PidController.c", "cc").is_file()
    for asked, words in (
        ("Controller", "Controller: expected UnifiedController or QuadrotorPlant, a folder"),
        ("examples/dc_servo/Pid", "examples/dc_servo/Pid: expected one of PidController, Servo in examples/dc_servo"),
    ):
        refused = main("export-c", asked, "--out", tmp_path, code=2)
        assert refused.stderr.startswith(f"quadcosim: {words}")
        assert refused.stderr.count("\n") == 1
