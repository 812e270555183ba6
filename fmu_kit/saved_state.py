"""Checks of a saved state before a slave restores it: it may come from a file that was damaged or forged.

The native part of pythonfmu 0.7.0 reads values without checking their types, and cannot free the class after an
exception while it creates or writes a state.
"""

import json
import zlib
from collections.abc import Sequence
from typing import Any

from fmu_kit.errors import FmuError, require
from fmu_kit.variables import Variable

State = dict[str, Any]  # of JSON types only: it is serialised as JSON

DEEPEST = 8
"""Allowed levels of lists and dictionaries in a state; the states of slaves have less than half as many."""

_KEPT: dict[str, tuple[type, ...]] = {
    "phase": (int,),
    "start_time": (float,),
    "stop_time": (float,),
    "reached": (float, type(None)),
    "stale": (bool,),
    "warned": (list,),
}
_INTEGERS = range(-(2**31), 2**31)
_CHECKSUM, DAMAGED = "checksum", "damaged"
"""Keys beside the parts of a state: its checksum, and that the checksum does not match"""


def serialise(state: State) -> bytes:
    """The bytes of a state, with its checksum."""
    return json.dumps({_CHECKSUM: _checksum(state), **state}).encode("utf-8")


def deserialise(content: bytes) -> State:
    """The state that was serialised, or one that `expect_state` refuses if `content` is anything else. Never raises."""
    try:
        state = json.loads(content.decode("utf-8"))
    except Exception:
        return {}
    if not (isinstance(state, dict) and _is_shallow(state, DEEPEST)):
        return {}
    checksum = state.pop(_CHECKSUM, None)
    return state if checksum == _checksum(state) else {**state, DAMAGED: True}


def expect_state(state: State, model: str, variables: Sequence[Variable]) -> None:
    """Raise `FmuError` unless `state` has all parts that a slave saves, with the right types."""
    reals = [v for v in variables if v.type == "Real"]
    given = state.get("reals", ())
    found = (state.get("model"), len(given) if isinstance(given, list | tuple) else 0)
    mine = (model, len(reals))
    require(found == mine, "FMU state (model, number of Reals)", found, f"{mine}")
    if DAMAGED in state:
        raise FmuError("FMU state (its bytes): expected them as they were serialised, their checksum is another")
    for variable, value in zip(reals, given):
        require(type(value) is float, f"FMU state ({variable.name})", repr(value), "a float")
    others = dict(enumerate(variables[len(reals) :], start=len(reals)))
    values = _by_reference(state.get("others"))
    require(values.keys() == others.keys(), "FMU state (others)", list(values), f"{list(others)}")
    for vr, variable in others.items():
        name, value = f"FMU state ({variable.name})", values[vr]
        if variable.type == "Boolean":
            require(value in (0, 1), name, repr(value), "0 or 1")
        else:
            require(type(value) is int and value in _INTEGERS, name, repr(value), "an integer of 32 bits")
    for key, (kind, *more) in _KEPT.items():
        value = state.get(key, ...)
        require(type(value) in (kind, *more), f"FMU state ({key})", repr(value), f"of type {kind.__name__}")
    require("internal" in state, "FMU state (internal)", "missing", "what the model saves")


def _checksum(state: State) -> int:
    return zlib.crc32(json.dumps(state).encode("utf-8"))


def _by_reference(pairs: Any) -> dict[int, Any]:
    """Values by value reference, from a list of pairs."""
    try:
        return {int(vr): value for vr, value in pairs}
    except (TypeError, ValueError, OverflowError):
        raise FmuError(f"FMU state (others) = {pairs!r}: expected pairs of value reference and value") from None


def _is_shallow(value: Any, levels: int) -> bool:
    """Whether lists and dictionaries are nested at most `levels` deep."""
    if not isinstance(value, list | dict):
        return True
    inner = value.values() if isinstance(value, dict) else value
    return levels > 0 and all(_is_shallow(one, levels - 1) for one in inner)
