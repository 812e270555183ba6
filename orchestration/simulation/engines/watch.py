"""The divergence monitor of a run: evaluates the condition of its system over the current row."""

import operator
from collections.abc import Callable, Mapping, Sequence

from orchestration.foundation.basics.errors import UsageError
from orchestration.simulation.engines.board import Board
from orchestration.simulation.engines.sources import SourceValues
from orchestration.systems.expressions.at_instant import Current, compiled
from orchestration.systems.expressions.syntax import Node, Operation, names, parse, text

Watch = Callable[[float], str | None]
"""Returns how the values of the row at t [s] have diverged; None if they have not"""


def watch(
    condition: str | None,
    board: Board,
    sources: Mapping[str, SourceValues],
    signals_of: Mapping[str, Sequence[str]],
    numbers: Mapping[str, float],
) -> Watch:
    """A divergence monitor for `condition`, over the board, `time`, the signals of sources and `numbers`, by name.

    Raises `UsageError` if the condition has an unknown name.
    """
    if condition is None:
        return lambda t: None
    node = parse(condition)
    named = set(names(node))
    columns = [c for c in board.columns if c != "time" and is_named(c, named)]
    used = [name for name, signals in signals_of.items() if any(is_named(signal, named) for signal in signals)]
    constants = [name for name in numbers if name in named]
    order = ["", "time", *columns, *(signal for name in used for signal in signals_of[name]), *constants]
    places = {name: i for i, name in enumerate(order)}
    try:
        clauses = [_Clause(clause, places) for clause in _alternatives(node)]
    except UsageError as error:
        raise UsageError(f"criterion.diverged: {error}") from None
    get = operator.itemgetter(
        0, 0, *(board.place[column] for column in columns)
    )  # two more than needed, so that it is a tuple
    row = board.row.data
    feeds, fixed = [sources[name].at for name in used], [float(numbers[name]) for name in constants]
    conditions = [clause.holds for clause in clauses]

    def check(t: float) -> str | None:
        values: list[float] = [*get(row)]
        values[1] = t
        for at in feeds:
            values += at(t)
        values += fixed
        for holds in conditions:
            if holds(values):
                return clauses[conditions.index(holds)].describe(values, t)
        return None

    return check


def is_named(signal: str, named: set[str]) -> bool:
    """Whether a signal is one of the names of an expression, or a component of a vector of them."""
    return signal in named or signal.rpartition(".")[0] in named


def _alternatives(node: Node) -> tuple[Node, ...]:
    return node.operands if isinstance(node, Operation) and node.sign == "or" else (node,)


class _Clause:
    """One of the conditions joined by `or`."""

    def __init__(self, node: Node, places: Mapping[str, int]) -> None:
        self.holds: Current = compiled(node, places)
        self._node = node
        self._left: Current | None = None
        if isinstance(node, Operation) and node.sign in _EXPECTED:
            self._left = compiled(node.operands[0], places)

    def describe(self, values: Sequence[float], t: float) -> str:
        """The value that diverged, and what was expected."""
        node = self._node
        if self._left is None or not isinstance(node, Operation):
            return f"{text(node)} at t = {t:g} s"
        left, right = node.operands
        expected = _EXPECTED[node.sign]
        return f"{text(left)} = {self._left(values):g} at t = {t:g} s, expected {expected} {text(right)}"


_EXPECTED = {">": "at most", ">=": "less than", "<": "at least", "<=": "more than"}
