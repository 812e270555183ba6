"""Values inside values: the numbers in tuples, lists, dictionaries and objects, by the path to each."""

from __future__ import annotations

import array
import collections
import copy
import enum
import functools
import itertools
import random
from collections.abc import Callable, Iterator, Sequence
from typing import Any, Literal

from fmu_kit.compiler.trace.symbols import Symbol, TraceError

Path = tuple[Any, ...]
USUAL_LEAVES = frozenset({Symbol, float, int, bool, str, bytes, type(None)})
"""Classes, of most of what is held: to be looked for before anything is called"""
_NUMBERS = frozenset({Symbol, float, int, bool})
_LEAVES = (*USUAL_LEAVES, type, enum.Enum)
_OPAQUE = (set, bytearray, array.array, collections.deque, random.Random, Iterator)
_DEEPEST = 12
_NONE: dict[str, Any] = {}


def is_number(value: Any) -> bool:
    """Whether a leaf is a number, known or not."""
    return type(value) in _NUMBERS or (isinstance(value, Symbol | float | int) and not isinstance(value, enum.Enum))


def children(value: Any) -> list[tuple[Any, Any]]:
    """What a value holds, with the key of each; nothing for a leaf.

    Raises `TraceError` for what may hold something that is not seen.
    """
    form = _form(type(value))  # type: ignore[arg-type]  # mypy takes a class for what has no hash
    if form == "leaf":
        return []
    if form == "object":
        held = [(name, getattr(value, name)) for name in _slots(type(value)) if hasattr(value, name)]  # type: ignore[arg-type]
        return held + [each for each in getattr(value, "__dict__", _NONE).items() if each[0][:2] != "__"]
    if form == "dict":
        return list(value.items())
    if form == "opaque":
        raise TraceError(f"{type(value).__name__}: expected numbers in tuples, lists, dictionaries and objects")
    return list(enumerate(value) if form == "sequence" else zip(value._fields, value))


@functools.cache
def _form(cls: type) -> Literal["leaf", "object", "dict", "opaque", "sequence", "named"]:
    """How what is of a class holds others."""
    if issubclass(cls, _LEAVES) or any("__call__" in vars(each) for each in cls.__mro__):
        return "leaf"
    if issubclass(cls, _OPAQUE):
        return "opaque"
    if issubclass(cls, tuple | list):
        return "named" if getattr(cls, "_fields", None) else "sequence"
    return "dict" if issubclass(cls, dict) else "object"


def attributes(value: Any) -> list[str]:
    """The names of the attributes of an object, of its slots and its dictionary."""
    slots = _slots(type(value))  # type: ignore[arg-type]
    return [*slots, *(name for name in getattr(value, "__dict__", ()) if not name.startswith("__"))]


@functools.cache
def _slots(cls: type) -> tuple[str, ...]:
    """The names of the slots of a class and those that it is made of."""
    named = [vars(each).get("__slots__", ()) for each in cls.__mro__]
    found = [name for slots in named for name in ((slots,) if isinstance(slots, str) else slots)]
    return tuple(name for name in found if not name.startswith("__"))


def leaves(value: Any) -> list[tuple[Path, Any]]:
    """Every leaf in a value, with the path to it."""
    found: list[tuple[Path, Any]] = []

    def collect(value: Any, path: Path) -> None:
        if len(path) > _DEEPEST:
            raise TraceError(f"{'.'.join(map(str, path))}: nested deeper than {_DEEPEST} levels")
        inside = children(value)
        if not inside:
            found.append((path, value))
        for key, child in inside:
            if type(child) in USUAL_LEAVES:
                found.append(((*path, key), child))
            else:
                collect(child, (*path, key))

    collect(value, ())
    return found


def bare_leaves(value: Any) -> Iterator[Any]:
    """Every leaf in a value, in the order of `leaves`."""
    inside = children(value)
    if not inside:
        yield value
    for _, child in inside:
        if type(child) in USUAL_LEAVES:
            yield child
        else:
            yield from bare_leaves(child)


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
    new = [
        (key, change((*path, key), child) if type(child) in USUAL_LEAVES else mapped(child, change, (*path, key)))
        for key, child in inside
    ]
    return _rebuilt(value, new)


def _rebuilt(value: Any, new: list[tuple[Any, Any]]) -> Any:
    """A value of the same class that holds something else."""
    if isinstance(value, list):
        return [child for _, child in new]
    if isinstance(value, tuple):
        return type(value)(*(child for _, child in new)) if hasattr(value, "_fields") else tuple(c for _, c in new)
    if isinstance(value, dict):
        return dict(new)
    made = copy.copy(value)
    for key, child in new:
        object.__setattr__(made, key, child)
    return made


def copied(value: Any) -> Any:
    """A copy of a value, down to its leaves."""
    inside = children(value)
    if not inside:
        return value
    return _rebuilt(value, [(key, child if type(child) in USUAL_LEAVES else copied(child)) for key, child in inside])


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
        if type(child) not in USUAL_LEAVES:
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


def expect_unchanged(before: Sequence[tuple[Path, Any]], given: Any, name: str) -> None:
    """Raise `TraceError` if what a method of this name was given has other leaves now: in C that would be a copy."""
    for one, other in itertools.zip_longest(before, leaves(given)):
        if one is None or other is None or one[0] != other[0] or not _are_same(one[1], other[1]):
            path = (one or other)[0]
            raise TraceError(
                f"{name} changes {path[0]}, which it is given: expected it to return what is new, or to change self"
            )


def _are_same(one: Any, other: Any) -> bool:
    return one is other or (
        not isinstance(one, Symbol)
        and type(one) is type(other)
        and type(one) in USUAL_LEAVES
        and repr(one) == repr(other)
    )


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
