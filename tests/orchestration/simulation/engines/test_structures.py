"""C and Python have the same structures, or the library is refused."""

import ctypes
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest

from orchestration.foundation.basics.c_structures import constants, declared
from orchestration.foundation.basics.errors import QuadcosimError
from orchestration.foundation.recording.recording import ARRIVED, LOST, SAMPLED, SENT
from orchestration.simulation.engines import compiled
from orchestration.simulation.engines.batch import kernels
from orchestration.simulation.engines.structures import shared, structures
from tests.orchestration.components.fmi.small import needs_compiler
from tests.orchestration.simulation.engines.batch.lanes import shape_of
from tests.orchestration.simulation.engines.moving import moving
from tests.orchestration.simulation.engines.test_compiled import LOOP, of

TEXT = """
enum { ONE, TWO }; /* what { is counted } */
typedef struct { /* a pair; of two */
    const double *first, second;
} Pair;
typedef struct {
    Pair pairs[2 * L];
    const Pair *other;
    uint32_t *numbers; /* of a type that is only pointed at */
    int32_t count, unused;
    int (*look)(double, int64_t);
} Held;
"""


def test_fields_are_those_that_the_header_declares() -> None:
    found = declared(TEXT, 4)
    assert [(name, kind) for name, kind in found["Pair"]._fields_] == [
        ("first", ctypes.c_void_p),
        ("second", ctypes.c_double),
    ]
    held = dict(found["Held"]._fields_)
    assert list(held) == ["pairs", "other", "numbers", "count", "unused", "look"]
    assert ctypes.sizeof(held["pairs"]) == 8 * ctypes.sizeof(found["Pair"])
    assert held["other"] is ctypes.c_void_p
    assert held["look"](lambda x, n: int(x) + n)(2.0, 3) == 5
    assert constants(TEXT) == {"ONE": 0, "TWO": 1}


def longer(lanes: int) -> Mapping[str, Any]:
    """The structures with one field more in that of a connection."""
    one_more = type("Channel", (structures(lanes).Channel,), {"_fields_": [("more", ctypes.c_int64)]})
    return {**shared(lanes), "Channel": one_more}


@needs_compiler
def test_a_loop_whose_structures_have_another_size_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    size = ctypes.sizeof(structures(1).Channel)
    monkeypatch.setattr(compiled, "shared", longer)
    compiled.library.cache_clear()
    with pytest.raises(QuadcosimError, match=f"^structure Channel has {size} bytes in C: expected {size + 8}, as in"):
        compiled.library()


@needs_compiler
def test_lanes_whose_structures_have_another_size_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    shape = shape_of(of(LOOP, moving(tmp_path)))
    size = ctypes.sizeof(structures(shape.lanes).Channel)
    monkeypatch.setattr(kernels, "shared", longer)
    kernels.batch.cache_clear()
    with pytest.raises(QuadcosimError, match=f"^structure Channel has {size} bytes in C: expected {size + 8}, as in"):
        _ = shape.library


@needs_compiler
def test_a_structure_that_a_library_does_not_have_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(compiled, "shared", lambda lanes: {**shared(lanes), "Another": structures(1).List})
    compiled.library.cache_clear()
    with pytest.raises(QuadcosimError, match="Another has no bytes in C: expected 16"):
        compiled.library()


def test_numbers_that_a_header_gives_are_counted_on_from() -> None:
    assert constants("enum { A, B = 7, C };") == {"A": 0, "B": 7, "C": 8}


def test_c_counts_what_happens_to_messages_as_recordings_do() -> None:
    c = structures(1)
    assert (c.SAMPLED, c.SENT, c.ARRIVED, c.LOST) == (SAMPLED, SENT, ARRIVED, LOST)
