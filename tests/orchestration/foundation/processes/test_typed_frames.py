"""What a process may send comes back as it was; anything else is refused before it takes memory or is executed."""

import pickle
import threading
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from types import MappingProxyType
from typing import Any

import msgpack
import numpy as np
import pytest

from orchestration.foundation.basics.errors import SimulatorError
from orchestration.foundation.processes.passable import passable
from orchestration.foundation.processes.typed_frames import DEEPEST, FrameError, call, expect, pack, unpack


@passable
@dataclass(frozen=True, kw_only=True)
class Leak:
    where: str
    rate: float | None
    parts: tuple["Leak", ...] = ()


@dataclass(frozen=True)
class NotInTheTable:
    where: str


@passable
class Litres(float):
    pass


class LeakError(Exception):
    pass


class NotALitre(float):
    pass


def test_data_come_back_as_they_were() -> None:
    for value in (
        None, True, -3, 2**200, 0.1, float("inf"), "text", "\udcff", b"bytes", [1, [2.0]], (1, (2, "three")),
        {"a": (1,)}, {(1, 2): None}, frozenset({"b", "a"}), Fraction(1, 3), Path("a/b"), np.float32(0.1), np.int64(3),
        1 - 2j, Litres(0.1), Leak(where="tank", rate=None, parts=(Leak(where="valve", rate=1.0),)),
    ):  # fmt: skip
        back = unpack(pack(value))
        assert (back, type(back)) == (value, type(value))
    assert unpack(pack(MappingProxyType({"a": 1}))) == {"a": 1}


@pytest.mark.parametrize("dtype", ["<f8", "<f4", "<i8", "|u1", "|b1", "<c16"])
def test_arrays_of_numbers_come_back_and_may_be_written(dtype: str) -> None:
    for values in (np.ones((3, 2), dtype), np.zeros((0, 5), dtype), np.ones((4, 3), dtype).T):
        back = unpack(pack(values))
        assert back.dtype == values.dtype
        assert np.array_equal(back, values)
        back[:] = 0


def test_an_error_comes_back_by_the_nearest_class_in_the_table() -> None:
    error = unpack(pack(SimulatorError("plant: refused", divergence=True, details="where")))
    assert (type(error), str(error), error.divergence, error.details, error.result) == (
        SimulatorError, "plant: refused", True, "where", None,
    )  # fmt: skip
    assert repr(unpack(pack(LeakError("in the tank")))) == "RuntimeError('LeakError: in the tank')"


@pytest.mark.parametrize(
    "value",
    [object(), NotALitre(1.0), threading.Lock(), len, NotInTheTable("tank"), np.array(["text"]), np.array([None])],
)
def test_what_is_no_data_cannot_be_sent(value: object) -> None:
    with pytest.raises(TypeError, match="no data that a process may send"):
        pack(value)


def ext(code: int, content: object) -> bytes:
    packed: bytes = msgpack.packb(msgpack.ExtType(code, msgpack.packb(content)))
    return packed


def nested(depth: int) -> Any:
    return () if depth == 0 else (nested(depth - 1),)


LEAK = f"{__name__}.Leak"
HOSTILE = {
    "a pickle": pickle.dumps({"a": 1}),
    "nothing": b"",
    "more after it": b"\x01\x01",
    "a list that is announced to be long": b"\xdd\xff\xff\xff\xff",
    "a table that is announced to be long": b"\xdf\xff\xff\xff\xff",
    "bytes that are announced to be many": b"\xc6\xff\xff\xff\xff",
    "lists without end": b"\x91" * 100_000,
    "tuples without end": pack(nested(DEEPEST + 2)),
    "an unknown code": ext(99, None),
    "an array of objects": ext(2, ["|O", [1], bytes(8)]),
    "an array of records": ext(2, ["f8,f8", [1], bytes(16)]),
    "an array of texts": ext(2, ["<U2", [1], bytes(8)]),
    "an array that is larger than its bytes": ext(2, ["<f8", [2**40], bytes(8)]),
    "an array of negative size": ext(2, ["<f8", [-1, -1], bytes(8)]),
    "an array of many dimensions": ext(2, ["<f8", [1] * 20, bytes(8)]),
    "a class that is not in the table": ext(3, ["os.system", ["true"]]),
    "an error as a record": ext(3, [f"{SimulatorError.__module__}.SimulatorError", ["true"]]),
    "a record without a field": ext(3, [LEAK, ["tank"]]),
    "a record with a field of another type": ext(3, [LEAK, ["tank", "much", []]]),
    "a record as an error": ext(4, [[LEAK], "text", {}]),
    "an error without a text": ext(4, [[], None, {}]),
    "an error with an attribute that is not plain": ext(4, [[], "text", {"args": [1]}]),
    "a key that cannot be one": msgpack.packb({"a": 1})[:1] + b"\x90\x01",
}


@pytest.mark.parametrize("what", HOSTILE)
def test_what_is_no_frame_is_refused(what: str) -> None:
    with pytest.raises(FrameError):
        unpack(HOSTILE[what])


class Handlers:
    def __init__(self) -> None:
        self.rates: dict[str, float] = {}

    def rate(self, where: str, rate: float) -> None:
        self.rates[where] = rate


@pytest.mark.parametrize(
    "message",
    [
        None,
        (),
        (1,),
        ("unknown",),
        ("__init__",),
        ("rate", "tank"),
        ("rate", "tank", "much"),
        ("rate", "tank", 1.0, 2.0),
    ],
)
def test_a_message_calls_no_method_but_those_of_the_list_and_with_nothing_but_their_arguments(message: object) -> None:
    handlers = Handlers()
    with pytest.raises(FrameError):
        call(handlers, message, ("rate",))
    assert handlers.rates == {}
    assert call(handlers, ("rate", "tank", 1.0), ("rate",)) == "rate"
    assert handlers.rates == {"tank": 1.0}


@pytest.mark.parametrize(
    ("kind", "fits", "does_not"),
    [
        (float | None, 1, "1"), (list[str], ["a"], ["a", 1]), (tuple[int, str], (1, "a"), (1, "a", 2)),
        (tuple[int, ...], (1, 2), (1, 2.5)), (dict[str, bool], {"a": True}, {"a": 1}), (Leak | bytes, b"", "text"),
        (bool, np.bool_(True), 1),
    ],
)  # fmt: skip
def test_content_must_fit_what_is_expected(kind: Any, fits: object, does_not: object) -> None:
    assert expect(fits, kind) is fits
    with pytest.raises(FrameError):
        expect(does_not, kind)
