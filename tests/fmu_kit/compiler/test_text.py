"""Numbers and messages are written in C as Python writes them, to the character."""

import ctypes
from collections.abc import Callable

import numpy as np
import pytest

from fmu_kit.compiler import runtime
from tests.fmu_kit.compiler.compiled import Floats, library

SIZE = 400  # characters of the longest number, and more
TWOS = np.ldexp(1.0, np.arange(-1074, 1024))
TENS = np.array([float(f"{m}e{e}") for e in range(-324, 309) for m in ("1", "2", "5", "9.5", "9.999999999999999")])
HALVES = np.arange(-300, 300) / 16
ODD = np.array([0.0, -0.0, np.inf, -np.inf, np.nan, -np.nan, 1e15, 1e16, 9999999999999998.0, 123456789012345680.0])
ROUNDED_UP = np.array([9.5, 99.5, 999999.5, 0.95, 0.096, 9.9999995e-5, 0.00099999995, 0.5, 1.5, 2.5])


@pytest.fixture(scope="module")
def texts(tmp_path_factory: pytest.TempPathFactory) -> ctypes.CDLL:
    """text.h over arrays."""
    return library("texts.c", tmp_path_factory.mktemp("texts"))


def lines(texts: ctypes.CDLL, kind: str, values: Floats, precision: int = 0) -> list[str]:
    """Numbers as text.h writes them."""
    size = len(values) * (SIZE if kind == "fixed" else 40)
    array = ctypes.create_string_buffer(size)
    function = getattr(texts, f"{kind}_lines")
    function.restype = ctypes.c_size_t
    pointer = np.ascontiguousarray(values).ctypes.data_as(ctypes.c_void_p)
    length = function(pointer, ctypes.c_size_t(len(values)), precision, array, ctypes.c_size_t(size))
    return array.raw[:length].decode("ascii").splitlines()


def with_neighbours(values: Floats) -> Floats:
    """The numbers, and the doubles above and below."""
    return np.concatenate([values, np.nextafter(values, np.inf), np.nextafter(values, -np.inf)])


def test_repr_of_random_bit_patterns_is_pythons(texts: ctypes.CDLL) -> None:
    values = np.random.default_rng(11).integers(0, 2**64, 200_000, dtype=np.uint64).view(np.float64)
    assert lines(texts, "repr", values) == list(map(repr, values.tolist()))


def test_repr_is_pythons_where_it_is_hard(texts: ctypes.CDLL) -> None:
    random = np.random.default_rng(12)
    subnormal = random.integers(0, 2**52, 20000, dtype=np.uint64).view(np.float64)
    short = np.round(random.uniform(-1000.0, 1000.0, 20000), 3)
    whole = random.integers(-(2**60), 2**60, 20000).astype(np.float64)
    values = np.concatenate([with_neighbours(TWOS), with_neighbours(TENS), subnormal, short, whole, HALVES, ODD])
    assert lines(texts, "repr", values) == list(map(repr, values.tolist()))


FORMATS: dict[str, Callable[[float, int], str]] = {
    "general": lambda x, precision: f"{x:.{precision}g}",
    "exponential": lambda x, precision: f"{x:.{precision}e}",
    "fixed": lambda x, precision: f"{x:.{precision}f}",
}


@pytest.mark.parametrize("precision", [0, 1, 3, 6, 17, 25])
@pytest.mark.parametrize("kind", FORMATS)
def test_formats_are_pythons(texts: ctypes.CDLL, kind: str, precision: int) -> None:
    random = np.random.default_rng(13)
    usual = random.uniform(-1.0, 1.0, 1000) * 10.0 ** random.integers(-8, 18, 1000)
    bits = random.integers(0, 2**64, 1000, dtype=np.uint64).view(np.float64)
    values = np.concatenate(
        [TWOS[::5], with_neighbours(TENS[::7]), usual, bits, HALVES, ODD, with_neighbours(ROUNDED_UP)]
    )
    expected = [FORMATS[kind](x, precision) for x in values.tolist()]
    assert lines(texts, kind, values, precision) == expected


@pytest.mark.parametrize("value", [0, 7, -1, 10**18, 2**63 - 1, -(2**63)])
def test_integers_and_truth_values_are_written_as_by_str(texts: ctypes.CDLL, value: int) -> None:
    array = ctypes.create_string_buffer(40)
    texts.integer_text(ctypes.c_int64(value), array, ctypes.c_size_t(40))
    assert array.value.decode() == f"{value} {value > 0}"


@pytest.mark.parametrize("size", range(1, 14))
def test_a_text_that_does_not_fit_ends_with_its_last_whole_character(texts: ctypes.CDLL, size: int) -> None:
    first, second = "a°β", "∞b𝜔"
    array = ctypes.create_string_buffer(b"x" * 20)
    texts.joined(first.encode(), second.encode(), array, ctypes.c_size_t(size))
    whole = first if len(first.encode()) > size - 1 else first + second
    assert array.value == whole.encode()[: size - 1].decode(errors="ignore").encode()
    assert array.raw[size:20] == b"x" * (20 - size)


def test_the_locale_changes_nothing(texts: ctypes.CDLL) -> None:
    """No function that knows of it is called."""
    source = (runtime.FOLDER / "text.h").read_text(encoding="utf-8")
    included = [line.split()[1] for line in source.splitlines() if line.startswith("#include")]
    assert included == ["<stddef.h>", "<stdint.h>", "<string.h>"]
