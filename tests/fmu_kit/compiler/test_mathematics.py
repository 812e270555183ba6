"""mathematics.h against numbers of many digits, against libm, and against itself as others compile it."""

import ctypes
import hashlib
import itertools
import math
import operator
import platform
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from elftools.elf.elffile import ELFFile

from tests.extent import sample, tries
from tests.fmu_kit.compiler.accuracy import STATED, Samples, arguments, largest_error
from tests.fmu_kit.compiler.compiled import HEADERS, Floats, compiled, compiler, library, processor, results

SAMPLES = tries(700, sampled=150)  # of each set of arguments
HASH = "e55b276ac5433a03"  # of all results of hash.c
FROM_LIBM = ["exp", "expm1", "log", "tanh", "sin", "cos", "tan", "asin", "acos", "atan", "atan2", "pow"]
MIN_DENORMAL, MIN_NORMAL, MAX_DOUBLE = 5e-324, 2.2250738585072014e-308, 1.7976931348623157e308
SPECIAL = [
    0.0,
    MIN_DENORMAL,
    MIN_NORMAL,
    1e-20,
    0.5,
    1.0,
    1.0000000000000002,
    1.5,
    2.0,
    3.0,
    4.0,
    37.0,
    1e10,
    2.0**53,
    MAX_DOUBLE,
    math.inf,
]
SPECIAL += [2.0**52 + 1.0, 0.9999999999999999, 710.0, 746.0, 1e300]
SPECIALS = np.array([*SPECIAL, *(-x for x in SPECIAL), math.nan])
LIBM = "-DQUADCOSIM_LIBM"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Where this module's programs are."""
    return tmp_path_factory.mktemp("mathematics")


@pytest.fixture(scope="module")
def own(folder: Path) -> ctypes.CDLL:
    """The own functions over arrays."""
    return library("loops.c", folder)


@pytest.fixture(scope="module")
def libm(folder: Path) -> ctypes.CDLL:
    """The same names, mapped to libm where CPython uses it."""
    return library("loops.c", folder, LIBM, "-lm")


def bits(values: Floats) -> list[int]:
    """The bits of numbers; of all that is none the same ones."""
    return np.where(np.isnan(values), math.nan, values).view(np.uint64).tolist()


def needed_symbols(program: Path) -> set[str]:
    """The names that a library leaves to others."""
    with program.open("rb") as file:
        symbols = ELFFile(file).get_section_by_name(".dynsym").iter_symbols()
        return {symbol.name for symbol in symbols if symbol.entry.st_shndx == "SHN_UNDEF"} - {""}


@pytest.mark.parametrize("name", STATED)
def test_no_error_is_larger_than_stated(own: ctypes.CDLL, name: str) -> None:
    error, where = largest_error(own, name, SAMPLES)
    assert error <= STATED[name], where


@pytest.mark.parametrize("name", FROM_LIBM)
def test_special_arguments_give_what_annex_f_of_the_c_standard_says_as_libm_does(
    own: ctypes.CDLL, libm: ctypes.CDLL, name: str
) -> None:
    chosen = np.array(list(itertools.product(SPECIALS, repeat=2 if name in ("atan2", "pow") else 1))).T
    ours, theirs = results(own, name, *chosen), results(libm, name, *chosen)
    plain = np.isfinite(theirs) & (theirs != 0.0)
    assert bits(ours[~plain]) == bits(theirs[~plain])
    apart = np.abs(ours[plain].view(np.int64) - theirs[plain].view(np.int64))
    assert apart.max() <= 1


def value_of(function: Callable[..., float], at: tuple[float, ...]) -> float:
    """A function of Python, infinite where Python raises an overflow."""
    try:
        return function(*at)
    except OverflowError:
        return math.inf


@pytest.mark.parametrize("name", FROM_LIBM)
def test_with_libm_the_bits_are_those_of_cpython(libm: ctypes.CDLL, name: str) -> None:
    function: Callable[..., float] = operator.pow if name == "pow" else getattr(math, name)
    for chosen in arguments(name, SAMPLES):
        expected = [value_of(function, at) for at in zip(*(argument.tolist() for argument in chosen))]
        assert bits(results(libm, name, *chosen)) == bits(np.array(expected))


def test_a_power_is_not_computed_by_the_compiler_in_its_own_way(folder: Path) -> None:
    """x**2 is pow(x, 2) in CPython: the last bit may not be that of x * x."""
    program = compiled("squares.c", folder / "squares.so", "-O2", "-shared", "-fPIC", LIBM)
    assert "pow" in needed_symbols(program)


PYTHONS: dict[str, Callable[..., float]] = {
    "hypot": math.hypot,
    "fmod": math.fmod,
    "modulo": operator.mod,
    "floor_divide": operator.floordiv,
    "max": max,
    "min": min,
    "copysign": math.copysign,
    "fabs": math.fabs,
    "floor": lambda x: math.copysign(math.floor(x), x),
    "ceil": lambda x: math.copysign(math.ceil(x), x),
    "trunc": lambda x: math.copysign(math.trunc(x), x),
    "round": lambda x: math.copysign(round(x), x),
    "sign": lambda x: math.copysign(1.0, x) if x else 0.0,
    "sqrt": math.sqrt,
}


@pytest.mark.parametrize("name", PYTHONS)
def test_exact_functions_are_pythons(own: ctypes.CDLL, name: str) -> None:
    s = Samples(3 * SAMPLES)
    numbers = np.concatenate([s.signed(-1074, 1023), s.signed(-3, 3), np.round(s.even(-9, 9)) / 2, SPECIALS])
    others = np.concatenate([s.random.permutation(numbers[: -len(SPECIALS)]), SPECIALS[::-1]])
    if name in ("max", "min", "copysign", "hypot"):
        chosen: tuple[Floats, ...] = (numbers, others)
    elif name in ("fmod", "modulo", "floor_divide"):
        usable = np.isfinite(numbers) & (others != 0.0)
        chosen = (numbers[usable], others[usable])
    elif name == "sqrt":
        chosen = (np.abs(numbers),)
    else:
        chosen = (numbers[np.isfinite(numbers)],)
    expected = np.array([value_of(PYTHONS[name], at) for at in zip(*(argument.tolist() for argument in chosen))])
    assert bits(results(own, name, *chosen)) == bits(expected)


# -- the same bits from everyone -----------------------------------------------------------------------------------

BUILDS = {
    "gcc without flags": ("gcc", ()),
    "gcc that contracts": ("gcc", ("-O1", "-march=native", "-ffp-contract=fast")),
    "loops as vectors of 4": ("gcc", ("-O3", "-mavx2", "-fno-math-errno")),
    "lanes of 4": ("gcc", ("-O1", "-mavx2", "-DQUADCOSIM_LANES=4")),
    "lanes of 8": ("gcc", ("-O1", "-mavx512f", "-DQUADCOSIM_LANES=8")),
    "lanes of 8 on any machine": ("gcc", ("-O0", "-DQUADCOSIM_LANES=8")),
    "roots by digits": ("gcc", ("-O0", "-DQUADCOSIM_SQRT_BY_DIGITS")),
    "clang without flags": ("clang", ()),
    "clang, lanes of 4": ("clang", ("-O1", "-mavx2", "-DQUADCOSIM_LANES=4")),
    "aarch64": ("aarch64-linux-gnu-gcc", ("-O1", "-static")),
    "riscv64": ("riscv64-linux-gnu-gcc", ("-O1", "-static")),
    "win64": ("x86_64-w64-mingw32-gcc", ("-O1", "-static")),
}
EMULATORS = {"aarch64": "qemu-aarch64", "riscv64": "qemu-riscv64", "win64": "wine"}


@pytest.mark.parametrize("build", sample([*BUILDS], 6))
def test_the_bits_are_the_same_from_every_compiler_in_any_lane_on_every_machine(folder: Path, build: str) -> None:
    name, flags = BUILDS[build]
    for flag in flags:
        if flag.startswith("-mavx") and flag.removeprefix("-m") not in processor():
            pytest.skip(f"the processor has no {flag.removeprefix('-m')}")
    program = compiled("hash.c", folder / f"{build.replace(' ', '_')}.exe", *flags, with_compiler=name)
    emulator = EMULATORS.get(build)
    if emulator and shutil.which(emulator) is None:
        pytest.skip(f"no {emulator}")
    command = [*([emulator] if emulator else []), str(program)]
    lines = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    assert hashlib.sha256(lines.encode()).hexdigest()[:16] == HASH, lines


@pytest.mark.skipif(platform.machine() != "x86_64", reason="options of x86-64")
@pytest.mark.parametrize(
    ("flag", "refused"),
    [("-mavx512fp16", ""), ("-mfpmath=387", "arithmetic in double precision"), ("-ffast-math", "without -ffast-math")],
)
def test_what_computes_double_otherwise_is_refused_and_half_precision_is_not(flag: str, refused: str) -> None:
    command = [compiler("gcc"), flag, "-fsyntax-only", "-x", "c", str(HEADERS / "lanes.h")]
    found = subprocess.run(command, capture_output=True, text=True, check=False)
    assert (found.returncode == 0, refused in found.stderr) == (not refused, True)


@pytest.mark.parametrize("flag", ["-O0", "-O2"])
def test_no_libm_is_needed(folder: Path, flag: str) -> None:
    program = compiled("loops.c", folder / f"loops{flag}.so", "-shared", "-fPIC", "-nostdlib", flag)
    assert needed_symbols(program) <= {"memcpy", "memset", "memmove"}
