"""Values inside values: the numbers in tuples, lists, dictionaries and objects, by the path to each."""

from __future__ import annotations

import copy
import enum
from collections.abc import Callable, Iterator
from typing import Any

from fmu_kit.native.symbols import Symbol, TraceError

Path = tuple[Any, ...]
_LEAVES = (Symbol, float, int, bool, str, bytes, type(None), type, enum.Enum)
_DEEPEST = 12


def is_number(value: Any) -> bool:
    """Whether a leaf is a number, known or not."""
    return isinstance(value, Symbol | float | int) and not isinstance(value, enum.Enum)


def children(value: Any) -> list[tuple[Any, Any]]:
    """What a value holds, with the key of each; nothing for a leaf."""
    if isinstance(value, _LEAVES) or callable(value):
        return []
    if isinstance(value, tuple | list):
        names = getattr(value, "_fields", None)
        return list(zip(names, value)) if names else list(enumerate(value))
    if isinstance(value, dict):
        return list(value.items())
    return [(name, getattr(value, name)) for name in attributes(value) if hasattr(value, name)]


def attributes(value: Any) -> list[str]:
    """The names of the attributes of an object, of its slots and its dictionary."""
    slots = [name for cls in type(value).__mro__ for name in _slots(cls)]
    return [name for name in (*slots, *getattr(value, "__dict__", ())) if not name.startswith("__")]


def _slots(cls: type) -> tuple[str, ...]:
    slots = vars(cls).get("__slots__", ())
    return (slots,) if isinstance(slots, str) else tuple(slots)


def leaves(value: Any, path: Path = ()) -> Iterator[tuple[Path, Any]]:
    """Every leaf in a value, with the path to it."""
    if len(path) > _DEEPEST:
        raise TraceError(f"{'.'.join(map(str, path))}: nested deeper than {_DEEPEST} levels")
    inside = children(value)
    if not inside:
        yield path, value
    for key, child in inside:
        yield from leaves(child, (*path, key))


def shape(value: Any) -> Any:
    """What a value is apart from its numbers: two of one shape can be merged."""
    if is_number(value):
        return "number"
    inside = children(value)
    if not inside:
        return value if isinstance(value, _LEAVES) or callable(value) else type(value)
    return (type(value), tuple((key, shape(child)) for key, child in inside))


def mapped(value: Any, change: Callable[[Path, Any], Any], path: Path = ()) -> Any:
    """A copy of a value with every leaf replaced."""
    inside = children(value)
    if not inside:
        return change(path, value)
    new = [(key, mapped(child, change, (*path, key))) for key, child in inside]
    if isinstance(value, list):
        return [child for _, child in new]
    if isinstance(value, tuple):
        return type(value)(*(child for _, child in new)) if hasattr(value, "_fields") else tuple(c for _, c in new)
    if isinstance(value, dict):
        return dict(new)
    copied = copy.copy(value)
    for key, child in new:
        object.__setattr__(copied, key, child)
    return copied


def mutable_objects(value: Any, found: dict[int, Any]) -> None:
    """Everything in a value that may be changed in place, by identity."""
    inside = children(value)
    if isinstance(value, tuple):
        pass
    elif inside or isinstance(value, list | dict):
        if id(value) in found:
            return
        found[id(value)] = value
    for _, child in inside:
        mutable_objects(child, found)


class Snapshot:
    """What some values hold, to be put back into them."""

    def __init__(self, *roots: Any) -> None:
        found: dict[int, Any] = {}
        for root in roots:
            mutable_objects(root, found)
        self._held = [(value, _content(value)) for value in found.values()]

    def restore(self) -> None:
        """Put everything back, in place."""
        for value, content in self._held:
            if isinstance(value, list):
                value[:] = content
            elif isinstance(value, dict):
                value.clear()
                value.update(content)
            else:
                for name in attributes(value):
                    if name not in content:
                        delattr(value, name)
                for name, child in content.items():
                    object.__setattr__(value, name, child)


def _content(value: Any) -> Any:
    if isinstance(value, list | dict):
        return value.copy()
    return dict(children(value))
