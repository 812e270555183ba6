"""Nested values: the numbers in tuples, lists, dictionaries and objects, by the path to each."""

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

from fmu_kit.compiler.trace.errors import TraceError
from fmu_kit.compiler.trace.symbols import Symbol

Path = tuple[Any, ...]
USUAL_LEAVES = frozenset({Symbol, float, int, bool, str, bytes, type(None)})
"""The most frequent classes of leaves, tested first for speed"""
_NUMBERS = frozenset({Symbol, float, int, bool})
_LEAVES = (*USUAL_LEAVES, type, enum.Enum)
_OPAQUE = (set, bytearray, array.array, collections.deque, random.Random, Iterator)
_DEEPEST = 12
_NONE: dict[str, Any] = {}


def is_number(value: Any) -> bool:
    """Whether a leaf is a number, known or a symbol."""
    return type(value) in _NUMBERS or (isinstance(value, Symbol | float | int) and not isinstance(value, enum.Enum))


def children(value: Any) -> list[tuple[Any, Any]]:
    """The parts of a value, each with its key; empty for a leaf.

    Raises `TraceError` for a value whose parts cannot be inspected.
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
    """How values of a class hold their parts."""
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
    """The names of the slots of a class and its bases."""
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
    """The structure of a value without its numbers: values of one shape can be merged."""
    if is_number(value):
        return "number"
    inside = children(value)
    if not inside:
        return value if isinstance(value, _LEAVES) or callable(value) else type(value)
    return (type(value), tuple((key, shape(child)) for key, child in inside))


def path_text(path: Path) -> str:
    """A path as a model writes it, without the name at which it begins."""
    names = [isinstance(part, str) and part.isidentifier() for part in path]
    return "".join(f".{part}" if is_name else f"[{part!r}]" for part, is_name in zip(path, names))


def difference(a: Any, b: Any, name: Callable[[Path], str]) -> str:
    """The first difference of two values other than in numbers; `name` names its place."""
    one, other = dict(leaves(a)), dict(leaves(b))
    for path in [*one, *other]:
        if path not in one or path not in other or shape(one[path]) != shape(other[path]):
            found = (_describe(each[path]) if path in each else "absent" for each in (one, other))
            return f"{name(path)} is {' and '.join(found)}"
    return "their types"


def _describe(leaf: Any) -> str:
    return "a number" if is_number(leaf) else repr(leaf)


def map_leaves(value: Any, change: Callable[[Path, Any], Any], path: Path = ()) -> Any:
    """A copy of a value with every leaf replaced."""
    inside = children(value)
    if not inside:
        return change(path, value)
    new = [
        (key, change((*path, key), child) if type(child) in USUAL_LEAVES else map_leaves(child, change, (*path, key)))
        for key, child in inside
    ]
    return _rebuilt(value, new)


def _rebuilt(value: Any, new: list[tuple[Any, Any]]) -> Any:
    """A value of the same class with other parts."""
    if isinstance(value, list):
        return [child for _, child in new]
    if isinstance(value, tuple):
        return type(value)(*(child for _, child in new)) if hasattr(value, "_fields") else tuple(c for _, c in new)
    if isinstance(value, dict):
        return dict(new)
    copied_object = copy.copy(value)
    for key, child in new:
        object.__setattr__(copied_object, key, child)
    return copied_object


def deep_copy(value: Any) -> Any:
    """A copy of a value, down to its leaves."""
    inside = children(value)
    if not inside:
        return value
    return _rebuilt(value, [(key, child if type(child) in USUAL_LEAVES else deep_copy(child)) for key, child in inside])


def collect_mutables(value: Any, found: dict[int, Any]) -> None:
    """Collect all mutable objects in a value, by identity."""
    inside = children(value)
    if isinstance(value, tuple):
        pass
    elif inside or isinstance(value, list | dict):
        if id(value) in found:
            return
        found[id(value)] = value
    for _, child in inside:
        if type(child) not in USUAL_LEAVES:
            collect_mutables(child, found)


def expect_no_aliases(value: Any) -> None:
    """Raise `TraceError` if one mutable object is in two places: in C they would be separate."""
    places: dict[int, Path] = {}

    def note(value: Any, path: Path) -> None:
        if isinstance(value, list | dict) or (
            children(value) and not isinstance(value, tuple) and not _is_frozen(value)
        ):
            if id(value) in places:
                one, other = (f"self{path_text(each)}" for each in (places[id(value)], path))
                raise TraceError(f"{one} and {other} are one {type(value).__name__}: expected separate objects")
            places[id(value)] = path
        for key, child in children(value):
            note(child, (*path, key))

    for key, child in children(value):
        note(child, (key,))


def expect_unchanged(before: Sequence[tuple[Path, Any]], given: Any, name: str) -> None:
    """Raise `TraceError` if a method of this name changed its arguments: in C these are copies."""
    for one, other in itertools.zip_longest(before, leaves(given)):
        if one is None or other is None or one[0] != other[0] or not _are_same(one[1], other[1]):
            path = (one or other)[0]
            raise TraceError(
                f"{name} changes its argument {path[0]}: expected it to return a new value, or to change self"
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
    """The content of mutable objects, to be restored."""

    def __init__(self, *roots: Any) -> None:
        found: dict[int, Any] = {}
        for root in roots:
            collect_mutables(root, found)
        self._held = [(value, _content(value)) for value in found.values()]

    def restore(self) -> None:
        """Restore all objects in place."""
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
