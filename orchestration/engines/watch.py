"""Looks, while a run goes on, whether it has diverged: the condition of its system over the current row."""

import operator
from collections.abc import Callable, Mapping, Sequence

from orchestration.basics.errors import UsageError
from orchestration.engines.board import Board
from orchestration.engines.sources import Values
from orchestration.expressions.at_instant import Current, compiled
from orchestration.expressions.syntax import Node, Operation, names, parse, text

Watch = Callable[[float], str | None]
"""At t [s], says how the values of the row have diverged, or None"""


def watch(
    condition: str | None,
    board: Board,
    sources: Mapping[str, Values],
    signals_of: Mapping[str, Sequence[str]],
    numbers: Mapping[str, float],
) -> Watch:
    """The look-out for `condition`, over the board, `time`, the signals of sources and `numbers`, by name.

    Raises `UsageError` if the condition names what is not there.
    """
    if condition is None:
        return lambda t: None
    node = parse(condition)
    wanted = set(names(node))
    columns = [c for c in board.columns if c != "time" and is_wanted(c, wanted)]
    used = [name for name, signals in signals_of.items() if any(is_wanted(signal, wanted) for signal in signals)]
    constants = [name for name in numbers if name in wanted]
    order = ["", "time", *columns, *(signal for name in used for signal in signals_of[name]), *constants]
    places = {name: i for i, name in enumerate(order)}
    try:
        clauses = [_Clause(clause, places) for clause in _alternatives(node)]
    except UsageError as error:
        raise UsageError(f"criterion.diverged: {error}") from None
    get = operator.itemgetter(0, 0, *(board.place[column] for column in columns))  # of one it would be no tuple
    row = board.row.data
    feeds, fixed = [sources[name].at for name in used], [float(numbers[name]) for name in constants]
    conditions = [clause.holds for clause in clauses]

    def look(t: float) -> str | None:
        values: list[float] = [*get(row)]
        values[1] = t
        for at in feeds:
            values += at(t)
        values += fixed
        for holds in conditions:
            if holds(values):
                return clauses[conditions.index(holds)].complaint(values, t)
        return None

    return look


def is_wanted(signal: str, wanted: set[str]) -> bool:
    """Whether a signal is one of the names of an expression, or a component of a vector of them."""
    return signal in wanted or signal.rpartition(".")[0] in wanted


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

    def complaint(self, values: Sequence[float], t: float) -> str:
        """What is wrong with the values, and what was expected."""
        node = self._node
        if self._left is None or not isinstance(node, Operation):
            return f"{text(node)} at t = {t:g} s"
        left, right = node.operands
        expected = _EXPECTED[node.sign]
        return f"{text(left)} = {self._left(values):g} at t = {t:g} s, expected {expected} {text(right)}"


_EXPECTED = {">": "at most", ">=": "less than", "<": "at least", "<=": "more than"}
