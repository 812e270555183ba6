"""Exploration of all paths through a slave's code, which become functions.

Code that is run on symbols takes one branch wherever it tests a condition. So it is run again for the other branch,
until all have been taken; then the paths are merged where they meet again: at the end of each function.
"""

from __future__ import annotations

import ast
import functools
import inspect
import itertools
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from fmu_kit.compiler.trace.errors import TraceError
from fmu_kit.compiler.trace.memory import Memory
from fmu_kit.compiler.trace.merging import Merge, PathEnd, storable_value
from fmu_kit.compiler.trace.statements import (
    Block,
    Call,
    Function,
    Statement,
    branch,
    error_class,
    has_effect,
    raise_statement,
    raises_of,
    statement,
    stores_of,
    warn_statement,
)
from fmu_kit.compiler.trace.symbols import Kind, Symbol, common_kind, decided, hooks, lifted, node, truth
from fmu_kit.compiler.trace.texts import marker
from fmu_kit.compiler.trace.tree import (
    bare_leaves,
    expect_no_aliases,
    expect_unchanged,
    is_number,
    leaves,
    map_leaves,
    shape,
)
from fmu_kit.errors import FmuError
from fmu_kit.failure import is_model_code


class _EndedError(BaseException):
    """Unwinds a path that ends in an error of the FMU."""


@dataclass(frozen=True)
class _Fork:
    """A point at which a path tested a condition."""

    condition: Symbol


@dataclass
class _Path:
    """One run of the code; `script` has the branches to take first."""

    script: tuple[bool, ...]
    known: dict[int, bool]
    refusal: str
    """why it is one path too many, which is said at its first condition; empty: it is not"""
    entries: list[Statement | _Fork] = field(default_factory=list)
    taken: list[bool] = field(default_factory=list)


@dataclass(frozen=True)
class _Tree:
    block: Block
    end: PathEnd | tuple[Symbol, _Tree, _Tree] | None


class Explorer:
    """Records the statements of the current path, and explores all paths."""

    def __init__(self, memory: Memory) -> None:
        self.memory = memory
        self.functions: list[Function] = []
        self._by_content: dict[Any, Function] = {}
        self._path: _Path | None = None
        self._depth = 0
        self._catches = False
        self._traced: dict[Any, tuple[Function, Any, Any]] = {}
        self._paths = 0

    def install_hooks(self) -> None:
        """Have the symbols call this explorer."""
        hooks.decide = self._decide
        hooks.fail_if = self.fail_if
        hooks.effects = lambda: sum(has_effect(each) for each in _statements(self._current.entries))
        hooks.is_running = lambda: self._path is not None

    # -- statements of a path -------------------------------------------------------------------------------

    def add(self, *statements: Statement) -> None:
        """Append statements to this path."""
        self._current.entries += statements

    def fail_if(self, condition: Any, error: Exception) -> None:
        """Append a statement: an error, if the condition holds."""
        condition = decided(condition)
        if condition is True:
            raise error
        known = self._current.known
        if condition is not False and known.get(id(condition)) is not False:
            self.add(*branch(truth(condition), (raise_statement(error),), ()))
            known[id(condition)] = False

    def warn(self, key: str, text: str) -> None:
        """Append a statement: a warning, the first time only."""
        self.add(warn_statement(key, text))

    @property
    def _current(self) -> _Path:
        if self._path is None:
            raise TraceError("a computed value is used outside of a traced call")
        return self._path

    def _decide(self, condition: Symbol) -> bool:
        if condition.op == "not":
            return not self._decide(condition.args[0])
        path = self._current
        if id(condition) in path.known:
            return path.known[id(condition)]
        if path.refusal:
            raise TraceError(path.refusal)
        at = len(path.taken)
        _expect_termination(at)
        branch_taken = path.script[at] if at < len(path.script) else True
        path.taken.append(branch_taken)
        path.known[id(condition)] = branch_taken
        path.entries.append(_Fork(condition))
        return branch_taken

    # -- all paths through a piece of code ---------------------------------------------------------------------

    def region(self, function: Callable[..., Any], args: tuple[Any, ...], kwargs: dict[str, Any]) -> Any:
        """Call a function, merging the paths through it."""
        outer = self._current
        held = self.memory.snapshot(args, kwargs)
        block, leaf, forked = self._explored(lambda: function(*args, **kwargs), (args, kwargs), held.restore)
        outer.entries += block
        if leaf is None:
            raise _EndedError
        if forked:
            self.memory.install(leaf.view, leaf.holders, (args, kwargs))
            self.memory.written, self.memory.version = dict(leaf.written), leaf.version
        return leaf.value

    def _explored(
        self, body: Callable[[], Any], roots: Any, restore: Callable[[], None]
    ) -> tuple[Block, PathEnd | None, bool]:
        tree, forked = self._tree(body, roots, restore)
        block, leaf = self._merged(tree)
        return block, leaf, forked

    def _tree(self, body: Callable[[], Any], roots: Any, restore: Callable[[], None]) -> tuple[_Tree, bool]:
        outer = self._path
        runs = 0

        def run(script: tuple[bool, ...]) -> tuple[_Path, PathEnd | None]:
            nonlocal runs
            if runs:
                restore()
            runs += 1
            self._paths += 1
            refusal = _TOO_MANY if runs > MAX_PATHS else _FAR_TOO_MANY if self._paths > MAX_SIZE else ""
            path = self._path = _Path(script, dict(outer.known) if outer else {}, refusal)
            leaf = None
            try:
                value = body()
                leaf = self._leaf(value, roots)
            except _EndedError:
                pass
            except (FmuError, ArithmeticError, ValueError) as error:
                path.entries.append(raise_statement(error))
            finally:
                self._path = outer
            return path, leaf

        def grown(script: tuple[bool, ...]) -> _Tree:
            path, leaf = run(script)
            forks = [i for i, entry in enumerate(path.entries) if isinstance(entry, _Fork)]
            start = forks[len(script) - 1] + 1 if script else 0

            def rest(start: int, depth: int) -> _Tree:
                if depth == len(forks):
                    return _Tree(_statements(path.entries[start:]), leaf)
                at = forks[depth]
                fork = path.entries[at]
                assert isinstance(fork, _Fork)
                then = rest(at + 1, depth + 1)
                otherwise = grown((*path.taken[:depth], False))
                return _Tree(_statements(path.entries[start:at]), (fork.condition, then, otherwise))

            return rest(start, len(script))

        return grown(()), runs > 1

    def _leaf(self, value: Any, roots: Any) -> PathEnd:
        view, holders = self.memory.view(roots)
        value, view = storable_value(value), storable_value(view)
        return PathEnd(value, view, holders, dict(self.memory.written), self.memory.version)

    def _merged(self, tree: _Tree) -> tuple[Block, PathEnd | None]:
        if not isinstance(tree.end, tuple):
            return tree.block, tree.end
        condition, then, otherwise = tree.end
        block_a, a = self._merged(then)
        block_b, b = self._merged(otherwise)
        leaf = a or b
        if a is not None and b is not None:
            merge = Merge(condition, self.memory, bool(block_a or block_b))
            leaf = merge.end(a, b)
            block_a, block_b = (*block_a, *merge.then), (*block_b, *merge.otherwise)
        return (*tree.block, *branch(condition, block_a, block_b)), leaf

    # -- functions -----------------------------------------------------------------------------------------------

    def call(self, method: Callable[..., Any], of: Callable[..., Any], arguments: dict[str, Any]) -> Any:
        """Call a method of the slave, `of` of its class, which becomes a separate function."""
        memory = self.memory
        self.add(*memory.flush())
        given = [lifted(leaf) for _, leaf in leaves(arguments) if is_number(leaf)]
        before = dict(memory.written)
        key = (of, shape(arguments), shape(memory.attributes()))
        if key not in self._traced:
            self._traced[key] = self.function(method, of.__name__, arguments)
        function, exit_view, returned = self._traced[key]
        call = statement("call", given, Call(function, memory.version))
        self.add(call)
        after = memory.next_version(call)
        if function.stores:
            memory.version = after
        if exit_view is None:
            raise _EndedError
        memory.update_after_call(exit_view, function.stores, before)
        if self._catches:
            for kind in sorted(function.raises):
                if node("failed", (), "bool", (kind, after)):
                    raise error_class(kind)(marker(node("failure", (), "real"), "failure"))
        numbers = [leaf for _, leaf in leaves(returned) if is_number(leaf)]
        results = iter([node("result", (), lifted(leaf).kind, (k, after)) for k, leaf in enumerate(numbers)])
        return map_leaves(returned, lambda _, leaf: next(results) if is_number(leaf) else leaf)

    def function(
        self, method: Callable[..., Any], name: str, arguments: dict[str, Any], *, catches: bool = False
    ) -> tuple[Function, Any, Any]:
        """A method, traced on parameters in place of its numeric arguments; the memory after it, and its result."""
        memory, outer, caught = self.memory, self._path, self._catches
        held, written, version = memory.snapshot(arguments, ()), memory.written, memory.version
        names: list[str] = []

        def parameter(path: Any, leaf: Any) -> Any:
            if not is_number(leaf):
                return leaf
            names.append(".".join(map(str, path)))
            return node("parameter", (), lifted(leaf).kind, len(names) - 1)

        given = map_leaves(arguments, parameter)
        leaves_before = leaves(given)
        memory.enter()
        start = memory.snapshot(given, ())
        self._path, self._catches = None, catches
        entered = dict(memory.written)

        def again() -> None:
            start.restore()
            memory.written, memory.version = dict(entered), 0

        try:
            block, leaf, _ = self._explored(lambda: method(**given), given, again)
        finally:
            self._path, self._catches = outer, caught
        exit_view, value = None, None
        results: list[Symbol] = []
        if leaf is not None:
            memory.install(leaf.view, leaf.holders, given)
            expect_unchanged(leaves_before, given, name)
            memory.written, memory.version = dict(leaf.written), leaf.version
            exit_view, value = memory.attributes(), leaf.value
            expect_no_aliases(exit_view)
            results = [lifted(leaf) for leaf in bare_leaves(value) if is_number(leaf)]
            block = (*block, *memory.flush(), statement("return", results))
        held.restore()
        memory.written, memory.version = written, version
        parameters = tuple(lifted(leaf) for _, leaf in leaves(given) if is_number(leaf))
        return (
            self._interned_function(name.lstrip("_"), method, (parameters, tuple(names)), block, len(results)),
            exit_view,
            value,
        )

    def _interned_function(
        self, name: str, method: Any, head: tuple[tuple[Symbol, ...], tuple[str, ...]], block: Block, results: int
    ) -> Function:
        parameters, names = head
        key = (name, tuple(map(id, parameters)), tuple(map(id, block)))
        if key not in self._by_content:
            taken = {each.name for each in self.functions}
            made = Function(
                name=next(each for each in _numbered(name) if each not in taken),
                parameters=parameters,
                names=names,
                body=block,
                results=results,
                stores=frozenset(stores_of(block)),
                raises=frozenset(raises_of(block)),
                doc=(getattr(method, "func", method).__doc__ or "").strip().partition("\n")[0],
            )
            self._by_content[key] = made
            self.functions.append(made)
        return self._by_content[key]

    # -- loops -----------------------------------------------------------------------------------------------------

    def repeat(self, count: Any, body: Callable[[Any, Any], Any], state: Any) -> Any:
        """`state = body(i, state)` for i = 0 … count - 1, where the count may be computed."""
        depth = self._depth
        self.add(*self.memory.flush())  # the functions that the body calls read the memory
        starts = [lifted(leaf) for _, leaf in leaves(state) if is_number(leaf)]
        kinds = [start.kind for start in starts]
        while True:
            block, nexts = self._looped(body, _with_numbers(state, "variable", kinds, depth))
            widened = [common_kind(node("variable", (), kind, None), next) for kind, next in zip(kinds, nexts)]
            if widened == kinds:
                break
            kinds = widened
        loop = statement("loop", (lifted(count), *starts, *nexts), depth, (block,))
        self._current.entries.append(loop)
        return _with_numbers(state, "outcome", kinds, loop)

    def _looped(self, body: Callable[[Any, Any], Any], state: Any) -> tuple[Block, list[Symbol]]:
        """The body of a loop, and the numbers that it returns."""
        index = node("index", (), "int", self._depth)
        before, version = self.memory.snapshot((), {}), self.memory.version
        kept, _ = self.memory.view(())
        self._depth += 1
        try:
            block, leaf, _ = self._explored(lambda: body(index, state), (), before.restore)
        finally:
            self._depth -= 1
        if leaf is None:
            raise TraceError("a loop that always fails")
        if leaf.version != version:
            raise TraceError(
                "repeat: its body calls a method that changes the slave, expected all changes in the returned state"
            )
        if not _is_same(leaf.view, kept):
            raise TraceError("repeat: its body changes the slave, expected all changes in the returned state")
        if shape(leaf.value) != shape(state):
            raise TraceError("repeat: expected the body to return what it is given, with other numbers")
        return block, [lifted(leaf) for _, leaf in leaves(leaf.value) if is_number(leaf)]


MAX_PATHS = 2000
"""Limit of the paths through one function; more would take minutes."""
MAX_SIZE = 50_000
"""Limit of the paths through all functions, and of their operations and statements; more would take minutes."""
FEWER = "expected a loop by fmu_kit.scalar.repeat, and methods for ifs that follow one another"
MAX_ROUNDS = 200
"""Limit of the rounds of a `while` with a computed condition: such a loop does not end while it is traced."""
_TOO_MANY = f"more than {MAX_PATHS} paths through this function: {FEWER}"
_FAR_TOO_MANY = f"more than {MAX_SIZE} paths through all functions: {FEWER}"


def _expect_termination(forks: int) -> None:
    """Raise `TraceError` on a path with so many forks that it is unlikely to end."""
    if forks >= MAX_PATHS:
        raise TraceError(_TOO_MANY)
    if forks and forks % MAX_ROUNDS == 0:
        frame = inspect.currentframe()
        while frame is not None and not is_model_code(frame.f_code.co_filename):
            frame = frame.f_back
        if frame is not None and any(frame.f_lineno in loop for loop in _loops_in(frame.f_code.co_filename)):
            rounds = f"more than {MAX_ROUNDS} rounds by a computed condition"
            raise TraceError(f"while: {rounds}, expected fmu_kit.scalar.repeat for a loop")


@functools.cache
def _loops_in(path: str) -> tuple[range, ...]:
    """The lines of each `while` loop in a file."""
    tree = ast.parse(Path(path).read_text("utf-8"))
    loops = [each for each in ast.walk(tree) if isinstance(each, ast.While)]
    return tuple(range(loop.lineno, (loop.end_lineno or loop.lineno) + 1) for loop in loops)


def _numbered(name: str) -> Iterator[str]:
    """Names for the functions traced from one method."""
    return itertools.chain((name,), (f"{name}__{k}" for k in itertools.count(2)))


def _with_numbers(state: Any, op: str, kinds: list[Kind], of: Any) -> Any:
    """A state whose numbers are replaced by those of a loop."""
    data = [(of, k) if op == "variable" else (k, of) for k in range(len(kinds))]
    numbers = iter([node(op, (), kind, where) for kind, where in zip(kinds, data)])
    return map_leaves(state, lambda _, leaf: next(numbers) if is_number(leaf) else leaf)


def _is_same(a: Any, b: Any) -> bool:
    """Whether two values hold the same numbers."""
    if shape(a) != shape(b):
        return False
    return all(lifted(x) is lifted(y) for (_, x), (_, y) in zip(leaves(a), leaves(b)) if is_number(x))


def _statements(entries: list[Statement | _Fork]) -> Block:
    return tuple(entry for entry in entries if isinstance(entry, Statement))
