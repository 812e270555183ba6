"""Values inside values: the numbers in tuples, lists, dictionaries and objects, by the path to each."""

from __future__ import annotations

import array
import collections
import copy
import enum
import random
from collections.abc import Callable, Iterator
from typing import Any

from fmu_kit.compiler.trace.symbols import Symbol, TraceError

Path = tuple[Any, ...]
_LEAVES = (Symbol, float, int, bool, str, bytes, type(None), type, enum.Enum)
_OPAQUE = (set, bytearray, array.array, collections.deque, random.Random, Iterator)
_DEEPEST = 12


def is_number(value: Any) -> bool:
    """Whether a leaf is a number, known or not."""
    return isinstance(value, Symbol | float | int) and not isinstance(value, enum.Enum)


def children(value: Any) -> list[tuple[Any, Any]]:
    """What a value holds, with the key of each; nothing for a leaf.

    Raises `TraceError` for what may hold something that is not seen.
    """
    if isinstance(value, _LEAVES) or callable(value):
        return []
    if isinstance(value, _OPAQUE):
        raise TraceError(f"{type(value).__name__}: expected numbers in tuples, lists, dictionaries and objects")
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


def written(path: Path) -> str:
    """A path as a model writes it, behind what it begins at."""
    names = [isinstance(part, str) and part.isidentifier() for part in path]
    return "".join(f".{part}" if is_name else f"[{part!r}]" for part, is_name in zip(path, names))


def difference(a: Any, b: Any, name: Callable[[Path], str]) -> str:
    """In what two values differ beside their numbers; `name` has the words for where."""
    one, other = dict(leaves(a)), dict(leaves(b))
    for path in [*one, *other]:
        if path not in one or path not in other or shape(one[path]) != shape(other[path]):
            found = (_in_words(each[path]) if path in each else "absent" for each in (one, other))
            return f"{name(path)} is {' and '.join(found)}"
    return "their types"


def _in_words(leaf: Any) -> str:
    return "a number" if is_number(leaf) else repr(leaf)


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


def expect_no_twins(value: Any) -> None:
    """Raise `TraceError` if one object that may be changed lies in two places: in C it would be two."""
    places: dict[int, Path] = {}

    def note(value: Any, path: Path) -> None:
        if isinstance(value, list | dict) or (
            children(value) and not isinstance(value, tuple) and not _is_frozen(value)
        ):
            if id(value) in places:
                one, other = (f"self{written(each)}" for each in (places[id(value)], path))
                raise TraceError(f"{one} and {other} are one {type(value).__name__}: expected one of its own")
            places[id(value)] = path
        for key, child in children(value):
            note(child, (*path, key))

    for key, child in children(value):
        note(child, (key,))


def _is_frozen(value: Any) -> bool:
    parameters = getattr(type(value), "__dataclass_params__", None)
    return parameters is not None and bool(parameters.frozen)


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
