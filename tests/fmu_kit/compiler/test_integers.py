"""Whole numbers in C are those of Python, or an error is reported: never another number."""

import ctypes
import importlib
import itertools
import operator
import random
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from fmu_kit.bundle import PackagingError, Target
from fmu_kit.compiler.emit.standards import STANDARDS
from fmu_kit.compiler.pack.building import build, c_sources, modules_of
from fmu_kit.compiler.pack.embedded_files import write
from fmu_kit.compiler.pack.lanes import compiled_lanes
from fmu_kit.compiler.trace import integers
from fmu_kit.compiler.trace.tracing import trace
from fmu_kit.packaging import slave_class
from tests.fmu_kit.compiler.compiled import compiler
from tests.fmu_kit.compiler.compiled import library as c_library
from tests.fmu_kit.compiler.embedded import STRICT, _succeeds
from tests.fmu_kit.compiler.in_lanes import Together
from tests.fmu_kit.compiler.twins import GUID, InC, InPython, answers, library

OPERATIONS: dict[str, Callable[[int, int], int]] = {
    "add": operator.add,
    "sub": operator.sub,
    "mul": operator.mul,
    "floordiv": operator.floordiv,
    "mod": operator.mod,
    "bit_and": operator.and_,
    "bit_or": operator.or_,
    "bit_xor": operator.xor,
}
MAX_INTEGER = 2**integers.BITS - 1
EDGES = [sign * (2**k + d) for k in (0, 31, 32, 53, 63, 64, 96, 126) for d in (-1, 0, 1) for sign in (-1, 1)]
SPANS = list(itertools.combinations_with_replacement((-17, -16, -9, -3, -1, 0, 1, 2, 7, 8, 15), 2))
SLAVE = """\
from fmu_kit.slave import Slave
from fmu_kit.interface import Output


class {model}(Slave):
    \"\"\"Draws.\"\"\"

    y = Output("A number.")

    def initialise(self, t):
        self._n = 1

    def step(self, t, h):
        self._n = {next}
        self.y = self._n / 65536
"""


def slave(folder: Path, monkeypatch: pytest.MonkeyPatch, model: str, next: str) -> Target:
    """A slave that draws one number after another."""
    monkeypatch.syspath_prepend(folder)
    (folder / f"draws_{model.lower()}.py").write_text(SLAVE.format(model=model, next=next))
    importlib.invalidate_caches()
    return Target(f"draws_{model.lower()}", model, folder)


class Number(ctypes.Structure):
    """As integers.h has it."""

    _fields_ = (("low", ctypes.c_uint64), ("high", ctypes.c_uint64))

    @classmethod
    def of(cls, value: int) -> "Number":
        """In two's complement."""
        return cls(value % 2**64, (value >> 64) % 2**64)

    def __int__(self) -> int:
        value = self.high << 64 | self.low
        return value - 2**128 if value >> 127 else value


def test_the_arithmetic_of_128_bits_is_that_of_python(tmp_path: Path) -> None:
    by = c_library("integers.c", tmp_path, "-fsanitize=undefined", "-fsanitize-undefined-trap-on-error")

    draw = random.Random(0)
    small = [draw.randint(-9, 9) for _ in range(40)]
    some = [*EDGES, *small, *(draw.randint(-(2**bits), 2**bits) for bits in (64, integers.BITS - 1) for _ in range(60))]
    for _ in range(10_000):
        name, a, b = draw.choice(sorted(OPERATIONS)), draw.choice(some), draw.choice(some)
        if b == 0 and name in ("floordiv", "mod"):
            continue
        expected = OPERATIONS[name](a, b)
        if abs(expected) > MAX_INTEGER:
            continue
        found = Number()
        getattr(by, name)(*map(ctypes.byref, (Number.of(a), Number.of(b), found)))
        assert int(found) == expected, (name, a, b)
        assert by.less(*map(ctypes.byref, (Number.of(a), Number.of(b)))) == (a < b)
        assert by.equal(*map(ctypes.byref, (Number.of(a), Number.of(b)))) == (a == b)


@pytest.mark.parametrize("name", OPERATIONS)
def test_no_result_lies_outside_of_what_is_said_of_it(name: str) -> None:
    for first, second in itertools.product(SPANS, SPANS):
        low, high = integers.span_of(name, first, second)
        pairs = itertools.product(*(range(span[0], span[1] + 1) for span in (first, second)))
        found = [OPERATIONS[name](a, b) for a, b in pairs if b or name not in ("floordiv", "mod")]
        assert all(low <= one <= high for one in found), (first, second)


def test_a_generator_of_random_numbers_draws_those_of_python(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    compiler("cc")
    target = slave(tmp_path, monkeypatch, "Congruential", "(self._n * 1103515245 + 12345) % 2147483648")
    path, cls = library(target, tmp_path), slave_class(target)
    expected = answers(InPython(cls(instance_name="draws")), {}, [{}] * 300)
    assert answers(InC.made(cls, path), {}, [{}] * 300) == expected
    (tmp_path / "lanes.so").write_bytes(
        compiled_lanes(c_sources(trace(cls, modules_of(target)), GUID, STANDARDS[2]), 4)
    )
    lanes, active = Together(tmp_path / "lanes.so"), np.array([True, True, False, True])
    lanes.begin()
    lanes.initialise(active, np.zeros(4))
    for k in range(300):
        lanes.step(active, np.full(4, 0.25 * k), np.full(4, 0.25))
        assert [lanes.memory[0, lane].hex() for lane in (0, 1, 3)] == 3 * [expected[k + 1][0]]


@pytest.mark.parametrize("single", [False, True])
def test_a_microcontroller_draws_those_of_python(single: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    model = "Single" if single else "Double"
    target = slave(tmp_path, monkeypatch, model, "(self._n * 1103515245 + 12345 - (self._n ^ 77)) % 65521")
    source = write(target, tmp_path, single=single)
    main = tmp_path / "main.c"
    main.write_text(
        f'#include <stdio.h>\n#include "{model}.h"\nint main(void)\n{{\n    {model} c;\n    {model}_init(&c);\n'
        f"    {model}_start(&c, 0);\n    for (int k = 0; k < 300; k++) {{\n        {model}_step(&c, 0, 1);\n"
        '        printf("%.0f\\n", (double)c.kept.n);\n    }\n    return 0;\n}\n'
    )
    _succeeds(
        [compiler("cc"), *STRICT, "-Wno-double-promotion", str(main), str(source), "-o", str(tmp_path / "a"), "-lm"]
    )
    numbers, n = [], 1
    for _ in range(300):
        n = (n * 1103515245 + 12345 - (n ^ 77)) % 65521
        numbers.append(n)
    assert list(map(int, _succeeds([str(tmp_path / "a")]).split())) == numbers


@pytest.mark.parametrize(
    ("name", "next", "steps"), [("Doubled", "self._n * 2", 53), ("Squared", "self._n * self._n + 2", 6)]
)
def test_a_number_that_c_cannot_keep_ends_the_run_in_words(
    name: str, next: str, steps: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    compiler("cc")
    target = slave(tmp_path, monkeypatch, name, next)
    cls = slave_class(target)
    found = answers(InC.made(cls, library(target, tmp_path)), {}, [{}] * 60)
    assert found[-1][0] == "failed"
    assert found[-1][1].startswith(
        "an integer is too large for C: expected integers smaller than 2**53, or larger ones"
    )
    assert len(found) == steps + 1  # the first of which is the initialisation
    assert found[:-1] == answers(InPython(cls(instance_name="draws")), {}, [{}] * 60)[:steps]


@pytest.mark.parametrize(
    ("name", "next", "words"),
    [
        (
            "Modulo",
            "(self._n * 6364136223846793005 + 1) % 2**64",
            "an integer of 64 bits: expected integers smaller than",
        ),
        (
            "Masked",
            "(self._n * 5 + 1 | 2**60) & 0xffffffffffffffff",
            "an integer of 64 bits: expected integers smaller",
        ),
        (
            "Large",
            "2**60",
            f"{2**60}: expected integers smaller than 2**53, or larger ones only within",
        ),
        ("Wide", "self._n * 2**80 % 7", "an integer of more than 127 bits: expected smaller ones, by % in between"),
        ("Shifted", "1 << self._n", "<< or >> by a computed integer: expected a known one"),
        (
            "Power",
            "self._n ** self._n",
            "** of two integers: expected a float among them, or an exponent that is known",
        ),
    ],
)
def test_what_c_can_never_keep_is_refused_while_it_is_built(
    name: str, next: str, words: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    target = slave(tmp_path, monkeypatch, name, next)
    with pytest.raises(PackagingError) as raised:
        build(target, tmp_path)
    assert words in str(raised.value)
