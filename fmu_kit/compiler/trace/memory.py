"""The memory of a slave between calls: its variables, and the attributes that its model sets."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

from fmu_kit.compiler.trace import tree
from fmu_kit.compiler.trace.errors import TraceError
from fmu_kit.compiler.trace.statements import Block, Place, Statement, statement
from fmu_kit.compiler.trace.symbols import Kind, Symbol, common_kind, lifted, node
from fmu_kit.slave import Slave

_KINDS: dict[str, Kind] = {"Real": "real", "Integer": "int", "Boolean": "bool", "Enumeration": "int"}
_TYPES: dict[Kind, str] = {"real": "a float", "int": "an integer", "bool": "a truth value"}
BASE_STATE = ("_reals", "_others", "_stale", "_start_time")


def attribute_name(path: tree.Path) -> str:
    """The name of a place that is not a variable, as a model writes it."""
    return f"self{tree.path_text(path)}"


@dataclass(frozen=True)
class KnownMemory:
    """Facts about a slave's memory from an earlier trace."""

    constants: Mapping[str, Symbol] = field(default_factory=dict)
    """the values of places that are never changed"""
    unread: frozenset[str] = frozenset()
    """places other than variables that nothing depends on"""

    def needs_no_place(self, place: Place) -> bool:
        """Whether a place is not a variable, and is constant or never read."""
        return place.reference is None and (place.name in self.constants or place.name in self.unread)


class Memory:
    """The memory of one slave while it is traced: every number in it has a place with a name."""

    def __init__(self, slave: Any, kinds: Mapping[str, Kind], known: KnownMemory = KnownMemory()) -> None:
        self.slave = slave
        self.known = known
        self.places: dict[str, Place] = {}
        self._names: dict[tree.Path, str] = {}
        self._kinds = kinds
        """Kinds of places, as far as known from an earlier trace"""
        self.first_kinds: dict[str, Kind] = {}
        """Kinds of places when first seen"""
        self.written: dict[str, Symbol] = {}
        """the current value of each place, as far as it has been written"""
        self.version = 0
        """Version of the memory; each call makes a new one"""
        self.versions: dict[tuple[int, Statement], int] = {}
        """version after each call, by the one before it and the call"""
        self._joined: dict[tuple[int, int, int], int] = {}
        self._base = _attributes_of_the_base() - set(BASE_STATE)

    # -- the attributes -----------------------------------------------------------------------------------------

    def attributes(self) -> dict[str, Any]:
        """The attributes that are memory, by name."""
        return {name: value for name, value in vars(self.slave).items() if name not in self._base}

    def _set_attributes(self, values: dict[str, Any]) -> None:
        for name in self.attributes().keys() - values.keys():
            delattr(self.slave, name)
        for name, value in values.items():
            setattr(self.slave, name, value)

    def expect_as_before(self, before: dict[str, Any], now: dict[str, Any], when: str, *, may_add: bool) -> None:
        """Raise `TraceError` if the memory changed in more than its numbers: a trace is valid for one structure."""
        for name, value in now.items():
            if hasattr(type(self.slave), name):
                raise TraceError(f"self.{name} hides the one of its class: expected another name, set by initialise")
            if name not in before and not may_add:
                raise TraceError(f"self.{name} is first set {when}: expected it set by initialise")
            if name in before and tree.shape(before[name]) != tree.shape(value):
                what = "the state" if name in BASE_STATE else f"self.{name}"
                found = tree.difference({name: before[name]}, {name: value}, self.name)
                raise TraceError(
                    f"{what} changes {when} in more than numbers: {found}; expected one structure from the start"
                )
        for name in before.keys() - now.keys():
            raise TraceError(f"self.{name} is deleted {when}: expected it to stay")

    def snapshot(self, args: Any, kwargs: Any) -> _MemoryState:
        """The current state of the memory and of the arguments of a call."""
        return _MemoryState(self, args, kwargs)

    def view(self, roots: Any) -> tuple[Any, dict[tree.Path, int]]:
        """A copy of the memory and of `roots`, and the identity of the object at each path."""
        everything = {"self": self.attributes(), "arguments": roots}
        holders: dict[tree.Path, int] = {}
        _note_holders(everything, (), holders)
        return tree.deep_copy(everything), holders

    def install(self, view: Any, holders: dict[tree.Path, int], roots: Any) -> None:
        """Set the memory to a view, keeping the objects that all paths left in place."""
        live = {"self": self.attributes(), "arguments": roots}
        grafted = _graft(live, view, (), holders)
        self._set_attributes(grafted["self"])

    # -- places -------------------------------------------------------------------------------------------------

    def name(self, path: tree.Path) -> str:
        """The name of a place."""
        found = self._names.get(path)
        if found is None:
            first, *rest = path
            is_variable = first in ("_reals", "_others") and rest
            found = self._names[path] = self.slave.variables[rest[0]].name if is_variable else attribute_name(path)
        return found

    def name_in_view(self, path: tree.Path) -> str:
        """The name of a part of a view, or of a returned value."""
        return self.name(path[1:]) if path[:1] == ("self",) else f"it{tree.path_text(path)}"

    def place(self, path: tree.Path, symbol: Symbol) -> Place:
        """The place of a path; it is created when first seen."""
        name = self.name(path)
        found = self.places.get(name)
        reference = path[1] if path[0] in ("_reals", "_others") else None
        if found is None:
            kind = self._kinds.get(name, symbol.kind)
            if reference is not None:
                kind = _KINDS[self.slave.variables[reference].type]
            found = self.places[name] = Place(name, kind, reference)
            self.first_kinds[name] = kind
        if found.kind == symbol.kind:
            return found
        if reference is None:
            found = self.places[name] = Place(name, common_kind(node("load", (), found.kind), symbol), None)
        elif (found.kind, symbol.kind) in (
            ("int", "real"),
            ("bool", "real"),
            ("bool", "int"),
        ) and symbol.op != "constant":
            raise TraceError(f"{name}: expected a value of its type, found {_TYPES[symbol.kind]}")
        return found

    def enter(self) -> None:
        """Forget all values: at the start of a function the content of the memory is unknown."""
        self.written = {}
        self.version = 0

        def load(path: tree.Path, leaf: Any) -> Any:
            if not tree.is_number(leaf):
                return leaf
            place = self.place(path, lifted(leaf))
            loaded = self.written[place.name] = self._read(place, 0)
            return loaded

        self._set_attributes({name: tree.map_leaves(value, load, (name,)) for name, value in self.attributes().items()})

    def _read(self, place: Place, version: int) -> Symbol:
        """The symbol for the value of a place in a version of the memory."""
        if place.name in self.known.constants:
            return self.known.constants[place.name]
        return node("load", (), place.kind, (place.name, version))

    def flush(self) -> Block:
        """The stores of all values that were changed."""
        stores = []
        for path, leaf in tree.leaves(self.attributes()):
            if not tree.is_number(leaf):
                continue
            symbol = lifted(leaf)
            place = self.place(path, symbol)
            if self.written.get(place.name) is not symbol and not self.known.needs_no_place(place):
                stores.append(statement("store", (symbol,), place.name))
                self.written[place.name] = symbol
        return tuple(stores)

    def update_after_call(self, exit_view: dict[str, Any], stores: Iterable[str], before: dict[str, Symbol]) -> None:
        """Update after a call: places that it stored are read anew, all others are unchanged."""
        stored = frozenset(stores)

        def now(path: tree.Path, leaf: Any) -> Any:
            if not tree.is_number(leaf):
                return leaf
            place = self.place(path, lifted(leaf))
            if place.name in stored or self.known.needs_no_place(place):
                self.written[place.name] = self._read(place, self.version)
            elif place.name not in before:
                raise TraceError(f"{place.name}: set on some paths only")
            else:
                self.written[place.name] = before[place.name]
            return self.written[place.name]

        self.written = dict(self.written)
        self._set_attributes({name: tree.map_leaves(value, now, (name,)) for name, value in exit_view.items()})

    def next_version(self, call: Statement) -> int:
        """The version after a call."""
        return self.versions.setdefault((self.version, call), self._unused())

    def joined(self, condition: Symbol, a: int, b: int) -> int:
        """The version after two paths with different versions."""
        return self._joined.setdefault((id(condition), a, b), self._unused())

    def _unused(self) -> int:
        return 1 + len(self.versions) + len(self._joined)


def _attributes_of_the_base() -> frozenset[str]:
    """The attributes of an instance of the base class; all others are set by the model."""
    bare = type("Bare", (Slave,), {"step": None})
    return frozenset(vars(bare(instance_name="bare")))


class _MemoryState:
    """A state of the memory that can be restored."""

    def __init__(self, memory: Memory, args: Any, kwargs: Any) -> None:
        self._memory = memory
        self._attributes = memory.attributes()
        self._written, self._version = dict(memory.written), memory.version
        self._objects = tree.Snapshot(*self._attributes.values(), args, kwargs)

    def restore(self) -> None:
        """Restore it."""
        self._objects.restore()
        self._memory._set_attributes(self._attributes)
        self._memory.written, self._memory.version = dict(self._written), self._version


def _note_holders(value: Any, path: tree.Path, found: dict[tree.Path, int]) -> None:
    inside = tree.children(value)
    if not isinstance(value, tuple) and (inside or isinstance(value, list | dict)):
        found[path] = id(value)
    for key, child in inside:
        if type(child) not in tree.USUAL_LEAVES:
            _note_holders(child, (*path, key), found)


def _graft(live: Any, new: Any, path: tree.Path, holders: dict[tree.Path, int]) -> Any:
    """`new`, but in the objects of `live` where all paths left these in place."""
    if type(new) in tree.USUAL_LEAVES or not tree.children(new):
        return new
    held = dict(tree.children(live)) if type(live) is type(new) else {}
    if path not in holders or holders[path] != id(live):
        if isinstance(new, tuple) and held.keys() == dict(tree.children(new)).keys():
            grafted = [_graft(held[key], child, (*path, key), holders) for key, child in tree.children(new)]
            if all(a is b for a, b in zip(grafted, held.values())):
                return live
            return type(new)(*grafted) if hasattr(new, "_fields") else tuple(grafted)
        if len(path) > 1 or not isinstance(new, dict):
            return new
        return {
            key: _graft(held[key], child, (*path, key), holders) if key in held else child for key, child in new.items()
        }
    for key, child in tree.children(new):
        now = _graft(held.get(key), child, (*path, key), holders) if key in held else child
        if now is not held.get(key):
            if isinstance(live, list | dict):
                live[key] = now
            else:
                object.__setattr__(live, key, now)
    return live
