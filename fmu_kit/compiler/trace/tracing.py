"""Tracing a slave: from its class to a program of functions.

Paths are merged where a function returns. So the functions of the slave's modules that branch are wrapped while it is
traced; each method of the slave becomes a separate function.
"""

from __future__ import annotations

import ast
import contextlib
import functools
import inspect
import textwrap
import types
from collections import OrderedDict
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from pythonfmu.fmi2slave import Fmi2Slave

from fmu_kit import scalar
from fmu_kit.compiler.trace import symbolic_builtins as stand_ins
from fmu_kit.compiler.trace.errors import TraceError
from fmu_kit.compiler.trace.memory import KnownMemory, Memory, attribute_name
from fmu_kit.compiler.trace.path_exploration import FEWER, MAX_SIZE, Explorer
from fmu_kit.compiler.trace.statements import Function, Place, Statement, all_statements, used_symbols
from fmu_kit.compiler.trace.symbols import Kind, Symbol, constant, hooks
from fmu_kit.compiler.trace.tree import leaves
from fmu_kit.failure import place_of
from fmu_kit.slave import Phase, Slave

_BASE_METHODS = ("_take_parameters", "_check_parameters")
_UNTRACED = ("internal_state", "restore", "to_xml")
_OPEN = frozenset({
    "__init__", "read_parameters", "initialise", "step", "derivatives", "next_jump", "internal_state", "restore",
    "to_xml",
})  # fmt: skip
"""The methods of the base class that a slave may override."""
MAX_WARNINGS = 32
"""Limit of the warnings of a slave; each key is a bit of its state."""


@dataclass(frozen=True, kw_only=True)
class Program:
    """A traced slave: functions over its memory."""

    model: str
    slave: type[Slave]
    places: tuple[Place, ...]
    """the variables by value reference, then the other numbers that the model keeps"""
    functions: tuple[Function, ...]
    """each after those that it calls"""
    initialise: Function
    """computes the outputs at the start time; no parameters"""
    do_step: Function
    """advances by a step; parameters t, h [s]"""
    warnings: tuple[str, ...]
    """keys of the warnings that are given once"""
    versions: Mapping[tuple[int, Statement], int]
    """Version of the memory after a call, by the one before it and the call"""
    of_derivatives: tuple[Function, ...] = ()
    """functions that only the derivatives need, which the last one computes: parameters t, since [s]"""
    states: tuple[tuple[int, Place], ...] = ()
    """the continuous states, each with the number of its derivative among the results"""

    def size(self) -> int:
        """The number of its operations and statements."""
        written = [[*all_statements(function.body)] for function in (*self.functions, *self.of_derivatives)]
        return sum(len(each) + sum(bool(symbol.args) for symbol in used_symbols(each).values()) for each in written)


def trace(slave: type[Slave], modules: list[types.ModuleType], *, digits: int = 53) -> Program:
    """The program of a slave class; `modules` are its own and all that it uses.

    `digits`: bits of the real numbers with which it will compute; whole numbers of so many bits are exact.
    Raises `TraceError` naming the line that cannot be traced.
    """
    hooks.digits = digits
    kinds: dict[str, Kind] = {}
    fixed = {v.name: constant(v.start) for v in slave.variables if v.variability == "constant"}
    known = KnownMemory(fixed)
    while True:
        memory = Memory(slave(instance_name="traced"), kinds, known)
        try:
            program = _traced(slave, modules, memory)
            if (size := program.size()) > MAX_SIZE:
                raise TraceError(f"{size} operations and statements, at most {MAX_SIZE}: {FEWER}")
        except Exception as error:
            raise TraceError(f"{_place(error)}{error}") from error
        found = {name: place.kind for name, place in memory.places.items() if place.reference is None}
        same = all(kinds.get(name, memory.first_kinds[name]) == kind for name, kind in found.items())
        more = _known_after(program, known) if fixed else known
        if same and more == known:
            return program
        kinds = found  # trace again: a place with first an integer, later a float is a float
        known = more  # and constants and unread places that follow from fixed values


def _known_after(program: Program, before: KnownMemory) -> KnownMemory:
    """What is known of the memory after a trace, in addition to what was known before."""
    first = {attribute_name(path) for path, _ in leaves(Memory(program.slave(instance_name="new"), {}).attributes())}
    kept = {place.name: place for place in program.places if place.reference is None and place.name not in first}
    functions = (*program.functions, *program.of_derivatives)
    each = [each for function in functions for each in all_statements(function.body)]
    stored: dict[str, set[Symbol]] = {}
    for store in each:
        if store.op == "store":
            stored.setdefault(store.data, set()).add(store.symbols[0])
    single = {name: values.pop() for name, values in stored.items() if name in kept and len(values) == 1}
    constants = {
        name: value for name, value in single.items() if (value.op, value.kind) == ("constant", kept[name].kind)
    }
    return KnownMemory({**before.constants, **constants}, before.unread | (kept.keys() - _read(each, kept.keys())))


def _read(statements: Sequence[Statement], kept: Collection[str]) -> set[str]:
    """The places that are read, other than to compute places that are themselves not read."""
    found: set[str] = set()
    while True:
        counting = [each for each in statements if each.op != "store" or each.data not in kept or each.data in found]
        loaded = {symbol.data[0] for symbol in used_symbols(counting).values() if symbol.op == "load"}
        if loaded <= found:
            return found
        found |= loaded


def _traced(slave: type[Slave], modules: list[types.ModuleType], memory: Memory) -> Program:
    instance = memory.slave
    explorer = Explorer(memory)
    explorer.install_hooks()
    warnings: list[str] = []

    def warn_once(self: Slave, key: str, text: str) -> None:
        if key not in warnings:
            warnings.append(key)
        if len(warnings) > MAX_WARNINGS:
            raise TraceError(f"more than {MAX_WARNINGS} keys of warnings")
        explorer.warn(key, text)

    _expect_no_override(slave)
    with _wrapped(slave, modules, explorer, warn_once):
        before = memory.attributes()
        initialise, after, _ = explorer.function(
            lambda: Slave._initialise(instance), "enter_stepping", {}, catches=True
        )
        if after is None:
            raise TraceError(f"{slave.__name__}.initialise always fails")
        memory.expect_as_before(before, after, "when it is initialised", may_add=True)
        memory._set_attributes(after)
        instance._phase = Phase.STEPPING
        step = functools.partial(Slave._advance, instance)
        do_step, stepped, _ = explorer.function(lambda t, h: step(t, h), "do_step", {"t": 0.0, "h": 0.0}, catches=True)
        if stepped is None:
            raise TraceError(f"{slave.__name__}.step always fails")
        memory.expect_as_before(after, stepped, "in a step", may_add=False)
        stepping = tuple(explorer.functions)
        if slave.continuous_states:
            derive = functools.partial(Slave._derive, instance)
            given = {"t": 0.0, "since": 0.0}
            _, derived, _ = explorer.function(lambda t, since: derive(t, since), "derive", given, catches=True)
            if derived is None:
                raise TraceError(f"{slave.__name__}.derivatives always fails")
            memory.expect_as_before(after, derived, "when derivatives are computed", may_add=False)
    variables = {place.reference: place for place in memory.places.values() if place.reference is not None}
    beside = [place for place in memory.places.values() if place.reference is None]
    kept = [place for place in beside if not memory.known.needs_no_place(place)]
    return Program(
        model=slave.__name__,
        slave=slave,
        places=(*(variables[i] for i in range(len(slave.variables))), *kept),
        functions=stepping,
        initialise=initialise,
        do_step=do_step,
        warnings=tuple(warnings),
        versions=memory.versions,
        of_derivatives=tuple(explorer.functions[len(stepping) :]),
        states=tuple((i, p) for i, p in enumerate(_states(slave, memory, after)) if not memory.known.needs_no_place(p)),
    )


def _states(slave: type[Slave], memory: Memory, after: Mapping[str, Any]) -> Iterator[Place]:
    """The places of the continuous states; `after` are the attributes when initialisation has ended."""
    declared = {each.attribute: each for each in slave._declared}
    for attribute in slave.continuous_states:
        if attribute in declared:
            yield from (memory.places[v.name] for v in declared[attribute].variables())
        else:
            yield from (memory.places[attribute_name((attribute, *path))] for path, _ in leaves(after[attribute]))


def _expect_no_override(slave: type[Slave]) -> None:
    """Raise `TraceError` if the slave overrides a method of the base class that implements FMI."""
    for cls in slave.__mro__[: slave.__mro__.index(Slave)]:
        for name in vars(cls):
            if name in vars(Slave) and name not in _OPEN and (name == "_initialise" or callable(vars(Slave)[name])):
                raise TraceError(f"{cls.__name__}.{name}: expected {', '.join(sorted(_OPEN - {'__init__'}))} only")


def _place(error: Exception) -> str:
    """File and line of the slave's code that an error comes from."""
    if isinstance(error, TraceError):
        return place_of(error) if error.place is None else f"{error.place}: "
    return f"{place_of(error)}{type(error).__name__}: "


@contextlib.contextmanager
def _wrapped(
    slave: type[Slave], modules: list[types.ModuleType], explorer: Explorer, warn_once: Callable[..., None]
) -> Iterator[None]:
    """Wrap every function that branches, and every method of the slave, by calls of the explorer."""
    lineage = slave.__mro__[: slave.__mro__.index(Slave)]
    changed: list[tuple[type, str, Any]] = []
    extra: dict[Any, Any] = {scalar.repeat: explorer.repeat}
    names = {module.__name__ for module in modules}

    def replace(cls: type, name: str, function: Any) -> None:
        changed.append((cls, name, vars(cls)[name]))
        setattr(cls, name, function)

    for module in modules:
        for value in list(vars(module).values()):
            if getattr(value, "__module__", None) not in names:
                continue
            if isinstance(value, types.FunctionType) and value is not scalar.repeat and _branches(value):
                extra[value] = _as_region(value, explorer)
            elif isinstance(value, type) and value.__module__ == module.__name__ and not issubclass(value, Slave):
                for name, method in list(vars(value).items()):
                    if isinstance(method, types.FunctionType) and not name.startswith("__") and _branches(method):
                        replace(value, name, _as_region(method, explorer))
    for cls in lineage:
        for name, method in list(vars(cls).items()):
            if isinstance(method, types.FunctionType) and not name.startswith("__") and name not in _UNTRACED:
                replace(cls, name, _as_function(method, explorer))
    for name in _BASE_METHODS:
        replace(Slave, name, _as_function(vars(Slave)[name], explorer))
    replace(Slave, "warn_once", warn_once)
    replace(Fmi2Slave, "log", _refuse_log)
    try:
        with stand_ins.installed(modules, extra):
            yield
    finally:
        for cls, name, value in reversed(changed):
            setattr(cls, name, value)


def _refuse_log(*given: Any, **options: Any) -> None:
    raise TraceError("self.log: expected self.warn_once")


def _as_region(function: Callable[..., Any], explorer: Explorer) -> Callable[..., Any]:
    @functools.wraps(function)
    def region(*args: Any, **kwargs: Any) -> Any:
        _expect_traceable(function)
        return explorer.region(function, args, kwargs)

    return region


def _as_function(method: Callable[..., Any], explorer: Explorer) -> Callable[..., Any]:
    signature = inspect.signature(method)

    own, *_ = signature.parameters

    @functools.wraps(method)
    def call(self: Any, *args: Any, **kwargs: Any) -> Any:
        _expect_traceable(method)
        bound = signature.bind(self, *args, **kwargs)
        bound.apply_defaults()
        given = {key: value for key, value in bound.arguments.items() if key != own}

        def again(**given: Any) -> Any:
            whole = inspect.BoundArguments(signature, OrderedDict({own: self, **given}))
            return method(*whole.args, **whole.kwargs)

        return explorer.call(again, method, given)

    return call


_UNTRACEABLE: dict[type[ast.stmt | ast.expr], str] = {
    ast.Try: "try: expected an if before what may fail",
    ast.With: "with: expected nothing that has to be closed",
    ast.Global: "global: expected values in the slave",
    ast.Await: "await: expected a plain function",
}


@functools.cache
def _untraceable(function: Callable[..., Any]) -> TraceError | None:
    for each in ast.walk(_tree_of(function)):
        for kind, words in _UNTRACEABLE.items():
            if isinstance(each, kind):
                error = TraceError(words)
                error.place = f"{inspect.getsourcefile(function)}, line {_first_line(function) + each.lineno - 1}"
                return error
    return None


def _expect_traceable(function: Callable[..., Any]) -> None:
    """Raise `TraceError` for a function with statements that cannot be traced."""
    error = _untraceable(function)
    if error is not None:
        raise error


def _first_line(function: Callable[..., Any]) -> int:
    return inspect.getsourcelines(function)[1]


def _tree_of(function: Callable[..., Any]) -> ast.AST:
    return ast.parse(textwrap.dedent(inspect.getsource(function)))


@functools.cache
def _branches(function: Callable[..., Any]) -> bool:
    """Whether a function branches, or has statements that cannot be traced."""
    if _untraceable(function) is not None:
        return True
    for each in ast.walk(_tree_of(function)):
        if isinstance(each, ast.If | ast.IfExp | ast.BoolOp | ast.While | ast.Assert):
            return True
        if isinstance(each, ast.Compare) and len(each.ops) > 1:
            return True
        if isinstance(each, ast.comprehension) and each.ifs:
            return True
    return False
