"""Expressions as C over SIMD lanes: at a row, just before the next, and half-way, as in `expressions/over_run.py`."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Literal, TypeAlias

from orchestration.systems.expressions.operators import OPERATORS
from orchestration.systems.expressions.over_run import alone, unknown
from orchestration.systems.expressions.syntax import Call, Name, Node, Number, Operation, Sampled

Moment: TypeAlias = Literal["row", "end", "middle"]
Kind: TypeAlias = Literal["number", "continuous", "held", "line"]
"""Changes of a value between rows: never in the run, continuously, not at all, or linearly"""


@dataclass(frozen=True, kw_only=True)
class Leaf:
    """The C of a name, and how its value changes."""

    code: str
    kind: Kind


class Section:
    """Lines of C, and the names of the values that they compute; those of a section `before` are known too."""

    def __init__(self, prefix: str, before: "Section | None" = None) -> None:
        self.lines: list[str] = []
        self._prefix, self._before, self._names = prefix, before, dict[object, str]()

    def named(self, key: object, code: Callable[[], str], kind: str = "q_real") -> str:
        """The name of a value, which is computed on first use."""
        known = self._known(key)
        if known is None:
            computed = code()
            known = self._names[key] = f"{self._prefix}{len(self.lines)}"
            self.lines.append(f"const {kind} {known} = {computed};")
        return known

    def _known(self, key: object) -> str | None:
        before = None if self._before is None else self._before._known(key)
        return self._names.get(key, before)


class ExpressionWriter:
    """Writes scalar expressions at an instant, as `scalars` makes them; values that they need are kept between rows.

    Its C calls `row` states STATE(i), and constants of a run CONSTANT(i).
    """

    def __init__(self, leaves: Mapping[str, Leaf], reductions: Mapping[Node, str]) -> None:
        self._leaves, self._reductions = leaves, reductions
        self.once = Section("c")
        """Code of what is constant in a run"""
        self.now = Section("x")
        """Code of what is computed at every row"""
        self.held = Section("h", self.now)
        """Code of what is computed at rows at which something that is held may have changed"""
        self.step = Section("e", self.now)
        """Code of what is computed for the step that ends at a row"""
        self.states: list[float] = []
        """initial values"""
        self.constants: dict[Node, int] = {}
        self._before: dict[Node, int] = {}
        self.slopes: dict[str, str] = {}
        """states with the slopes of signals that are extrapolated linearly, where needed"""

    def state(self, begin: float = 0.0) -> str:
        """The C of a new state: a number of each lane that is kept between rows."""
        self.states.append(begin)
        return f"STATE({len(self.states) - 1})"

    def before(self, node: Node) -> str:
        """The value of an expression at the row before."""
        if node not in self._before:
            self.state()
            self._before[node] = len(self.states) - 1
            self.value(node, "row", self._section_of(node))
        return f"STATE({self._before[node]})"

    def remembered(self, section: Section) -> list[str]:
        """Lines that keep the values requested by `before` that are computed in a section."""
        states = {f"STATE({i})": node for node, i in self._before.items() if self._section_of(node) is section}
        values = {state: self.value(node, "row", section) for state, node in states.items()}
        return [f"{state} = q_select(m, {value}, {state});" for state, value in values.items()]

    def _section_of(self, node: Node) -> Section:
        return self.held if self.is_held(node) else self.now

    def is_held(self, *nodes: Node) -> bool:
        """Whether the values of expressions change only where something that is held does."""
        return all(self.kinds(node) <= {"number", "held"} for node in nodes)

    def kinds(self, node: Node) -> set[Kind]:
        """How the values in an expression change between rows."""
        if isinstance(node, Name):
            return {self.leaf(node.text).kind}
        if node in self._reductions:
            return {"number"}
        parts = node.operands if isinstance(node, Operation) else getattr(node, "arguments", ())
        return {kind for part in parts for kind in self.kinds(part)}

    def value(self, node: Node, place: Moment, into: Section) -> str:
        """The C of the value of an expression."""
        kinds = self.kinds(node)
        if isinstance(node, Number):
            return f"q_all({node.value!r})"
        if kinds <= {"number"} and into is not self.once:
            self.value(node, "row", self.once)
            return f"CONSTANT({self.constants.setdefault(node, len(self.constants))})"
        if place == "end" and kinds <= {"number", "continuous"}:
            place = "row"
        if place != "row" and kinds <= {"number", "held"}:
            return self.before(node)
        return into.named((node, place), lambda: self._code(node, place, into))

    def truth(self, node: Node, place: Moment, into: Section) -> str:
        """The mask of the lanes in which an expression is not zero."""
        is_here = place == "row" or self.kinds(node) - {"number", "held"}
        if (
            isinstance(node, Operation)
            and OPERATORS[node.sign].gives_truth
            and is_here
            and self.kinds(node) - {"number"}
        ):
            return into.named((node, place, "truth"), lambda: self._truth(node, place, into), "q_mask")
        return f"q_ne({self.value(node, place, into)}, 0.0)"

    def leaf(self, name: str) -> Leaf:
        """The leaf of a name; raises `UsageError` for an unknown one."""
        if name not in self._leaves:
            raise unknown(name)
        return self._leaves[name]

    def _code(self, node: Node, place: Moment, into: Section) -> str:
        match node:
            case Name(name):
                return self._at(node, self.leaf(name), place)
            case Operation(sign) if OPERATORS[sign].gives_truth:
                return f"TRUE({self._truth(node, place, into)})"
            case Sampled(connection, _):
                raise alone(connection)
            case Operation(word, operands) | Call(word, operands) if node not in self._reductions:
                return OPERATORS[word].lanes(*(self.value(operand, place, into) for operand in operands))
        return self._reductions[node]

    def _at(self, node: Name, leaf: Leaf, place: Moment) -> str:
        if place == "row":
            return leaf.code
        before = self.before(node)
        if leaf.kind == "continuous":
            return f"0.5 * ({before} + {self.value(node, 'row', self.now)})"
        if node.text not in self.slopes:
            self.slopes[node.text] = self.state()
        end = f"({before} + {self.slopes[node.text]} * dt)"
        return end if place == "end" else f"0.5 * ({before} + {end})"

    def _truth(self, node: Operation, place: Moment, into: Section) -> str:
        write = self.truth if OPERATORS[node.sign].takes_truths else self.value
        return OPERATORS[node.sign].lanes(*(write(operand, place, into) for operand in node.operands))
