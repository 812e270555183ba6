"""The structures of loop.c, field by field."""

import ctypes
from ctypes import POINTER, Structure, c_double, c_int32, c_int64, c_size_t, c_void_p
from typing import Any, ClassVar

import numpy.typing as npt


def address(array: npt.NDArray[Any]) -> int:
    """Where the values of an array, contiguous, are; whoever asks keeps the array."""
    return int(array.ctypes.data)


class Part(Structure):
    """One call that moves values of one type between an FMU and a buffer."""

    _fields_: ClassVar = [
        *((name, c_void_p) for name in ("function", "fmu", "references")),
        ("count", c_size_t), ("buffer", c_void_p), ("values", c_size_t), ("asked", c_void_p), ("places", c_void_p),
        ("size", c_int64), ("type", c_int32), ("counts_values", c_int32), ("low", c_double), ("high", c_double),
        ("component", c_int64),
    ]  # fmt: skip


class Transfer(Structure):
    """The calls that move the values of one array."""

    _fields_: ClassVar = [("parts", POINTER(Part)), ("count", c_int64), ("array", c_void_p)]


class List(Structure):
    """Indices."""

    _fields_: ClassVar = [("items", c_void_p), ("count", c_int64)]


class Component(Structure):
    """A component at work."""

    _fields_: ClassVar = [
        ("fmu", c_void_p), ("step", c_void_p), ("version", c_int32), ("by_itself", c_int32),
        ("foreign", c_int32), ("moved", c_int32),
        *((name, c_void_p) for name in ("event", "ends", "early", "reached", "heard")),
        ("read", Transfer), ("outputs", c_void_p), ("connected", c_int64),
        *((name, List) for name in ("feeds", "held", "ahead", "behind")),
        ("ratio", c_double), ("now", c_int64),
    ]  # fmt: skip


class Feed(Structure):
    """A source at work on inputs of one component."""

    _fields_: ClassVar = [("write", Transfer), ("values", c_void_p), ("size", c_int64)]


class Channel(Structure):
    """A connection at work."""

    _fields_: ClassVar = [
        ("write", Transfer), ("row", c_void_p), ("places", c_void_p), ("size", c_int64),
        *((name, c_int32) for name in ("noisy", "rounds", "converts", "extrapolates", "read_ahead", "unused")),
        *((name, c_void_p) for name in ("sigma", "noise", "quantum")),
        ("scale", c_double), ("offset", c_double), ("flight", c_void_p), ("first", c_int64), ("last", c_int64),
        ("applied", c_void_p), ("applied_count", c_int64), ("applied_time", c_int64 * 2), ("value", c_void_p),
    ]  # fmt: skip


SCHEDULE = (
    "times", "halts_at", "halts", "posted_at", "measured_at", "arrivals_at", "dues_at", "posted", "measured",
    "arrivals", "exchanged", "dues",
)  # fmt: skip
"""Arrays of a `Schedule`, as loop.c has them in order"""


class Schedule(Structure):
    """What happens when."""

    _fields_: ClassVar = [(name, c_void_p) for name in SCHEDULE]


class Operation(Structure):
    """One step of a condition."""

    _fields_: ClassVar = [("code", c_int64), ("operands", c_int64), ("number", c_double)]


Look: Any = ctypes.CFUNCTYPE(ctypes.c_int, c_double)
Stopped: Any = ctypes.CFUNCTYPE(ctypes.c_int, ctypes.c_int, c_int64)
Collect: Any = ctypes.CFUNCTYPE(None, c_int64)


class Loop(Structure):
    """A run."""

    _fields_: ClassVar = [
        ("components", POINTER(Component)), ("channels", POINTER(Channel)), ("feeds", POINTER(Feed)), ("tasks", List),
        ("some_by_themselves", c_int64), ("settles", c_int64), ("schedule", Schedule), ("stop", c_int64),
        ("pause_at", c_int64), ("row", c_void_p), ("rows", c_void_p), ("width", c_int64), ("stride", c_int64),
        ("row_count", c_int64), ("row_limit", c_int64), ("events", c_void_p), ("arrived", c_void_p),
        ("event_count", c_int64), ("event_limit", c_int64), ("arrived_count", c_int64), ("at", c_int64),
        ("steps", c_int64), ("now", c_int64), ("failed", POINTER(Part)), ("component", c_int64), ("end", c_double),
        ("is_over", c_int64), ("look", Look), ("stopped", Stopped), ("collect", Collect),
        ("condition", POINTER(Operation)), ("condition_length", c_int64), ("watched", c_void_p),
        ("watched_size", c_int64), ("calling", c_int64), ("mode", c_int64), ("environment", c_void_p),
    ]  # fmt: skip


TYPES = (
    "float64", "float32", "int8", "uint8", "int16", "uint16", "int32", "uint32", "int64", "uint64", "bool", "boolean32",
)  # fmt: skip
"""What a buffer holds, as loop.c counts them"""
