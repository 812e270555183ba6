"""The structures of batch.c, field by field."""

from ctypes import POINTER, Structure, c_int32, c_int64, c_uint64, c_void_p
from typing import Any, ClassVar

from orchestration.engines.structures import SCHEDULE, List, address

__all__ = ["SCHEDULE", "Component", "Fed", "Kept", "List", "Schedule", "address", "batch_of", "channel_of", "track_of"]


class Fed(Structure):
    """A value of a source, and the place of the input that gets it."""

    _fields_: ClassVar = [("source", c_int64), ("place", c_int64)]


class Component(Structure):
    """A component at work in all lanes."""

    _fields_: ClassVar = [
        ("step", c_void_p), ("memory", c_void_p), ("outputs", c_void_p), ("connected", c_int64),
        ("fed", c_void_p), ("fed_count", c_int64), *((name, List) for name in ("held", "ahead", "behind")),
        ("ratio", c_void_p), ("by_itself", c_int64), ("settles", c_int64),
    ]  # fmt: skip


class Schedule(Structure):
    """What happens when."""

    _fields_: ClassVar = [(name, c_void_p) for name in SCHEDULE]


class Kept(Structure):
    """Values that are kept row by row."""

    _fields_: ClassVar = [("values", c_void_p), ("count", c_int64), ("capacity", c_int64)]


def channel_of(lanes: int) -> Any:
    """The structure of a connection at work in so many lanes."""

    class Channel(Structure):
        _fields_: ClassVar = [
            ("sender", c_void_p), ("receiver", c_void_p), ("from_", c_void_p), ("to", c_void_p), ("size", c_int64),
            *((name, c_void_p) for name in ("kinds", "low", "high")),
            *((name, c_int32) for name in ("noisy", "rounds", "converts", "extrapolates")),
            *((name, c_int32) for name in ("read_ahead", "plain", "as_they_are", "unused")),
            *((name, c_void_p) for name in ("sigma", "quantum", "scale", "offset")),
            ("noise", c_void_p * lanes), ("value", c_void_p), ("flight", c_void_p), ("capacity", c_int64),
            ("first", c_int64 * lanes), ("last", c_int64 * lanes), ("applied", c_void_p),
            ("applied_count", c_int64 * lanes), ("applied_time", c_int64 * (2 * lanes)),
        ]  # fmt: skip

    return Channel


def track_of(lanes: int) -> Any:
    """The structure of runs that share a schedule."""

    class Track(Structure):
        _fields_: ClassVar = [
            ("schedule", Schedule), ("count", c_int64), ("at", c_int64), ("last_window", c_int64), ("lanes", c_uint64),
            ("stop", c_int64), ("now", c_void_p), ("seen", c_void_p * lanes), ("given", c_void_p * lanes),
            ("one_for_all", c_int64), ("unused", c_int64),
        ]  # fmt: skip

    return Track


def batch_of(lanes: int, channel: Any, track: Any) -> Any:
    """The structure of runs in so many lanes."""

    class Batch(Structure):
        _fields_: ClassVar = [
            ("components", POINTER(Component)), ("component_count", c_int64),
            ("channels", POINTER(channel)), ("channel_count", c_int64), ("bodies", List), ("tasks", List),
            ("tracks", POINTER(track)), ("track_count", c_int64), ("track", c_int64), ("alive", c_uint64),
            ("full", c_uint64), ("seen_count", c_int64), ("given_count", c_int64),
            *((name, c_void_p) for name in ("seen", "given", "state", "constants", "numbers")),
            ("doubtful", c_uint64), ("kept", POINTER(Kept)),
            *((name, c_int64 * lanes) for name in ("fate", "fate_component", "fate_time", "steps")),
            ("status", c_void_p), ("recorded_count", c_int64), ("record_limit", c_int64), ("recorded", c_void_p),
            ("records", c_void_p * lanes), ("record_counts", c_int64 * lanes),
        ]  # fmt: skip

    return Batch
