"""The grammar of expressions: Python's, cut down to arithmetic, comparisons, logic, names and known functions."""

import ast
import functools
import math
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any, TypeAlias

from fmu_kit.syntax_trees import parse_expression
from orchestration.foundation.basics.errors import UsageError, did_you_mean
from orchestration.systems.expressions.operators import OPERATORS
from orchestration.systems.expressions.reductions import REDUCTIONS

MAX_EXPRESSION_LENGTH, MAX_NESTING = 10_000, 60
"""The most characters, and the deepest nesting, of an expression"""

SAMPLED = "sampled"
"""`sampled(CONNECTION, x)`: the values of x at the rows at which a message of that connection arrived"""


JOB_MEASURES = ("response", "missed")
"""`response(TASK)`, `missed(TASK)`: measures of the jobs of a task, as `control` or COMPUTER.TASK"""


@dataclass(frozen=True)
class Number:
    """A literal."""

    value: float


@dataclass(frozen=True)
class Name:
    """A signal, an objective, `time` or `stop_time`; in quotes if it is not of identifiers, as `"ball.der(h)"`."""

    text: str


class _Nested:
    """An expression with nested ones, used as a key: its hash is computed once."""

    @functools.cached_property
    def _hash(self) -> int:
        return hash(tuple(vars(self).values()))

    def __hash__(self) -> int:
        return self._hash

    def __getstate__(self) -> dict[str, Any]:  # hashes of text differ between processes
        return {name: value for name, value in vars(self).items() if name != "_hash"}


@dataclass(frozen=True)
class Operation(_Nested):
    """An operator of `OPERATORS` with its operands; the sign of a number is `neg`."""

    sign: str
    operands: tuple["Node", ...]

    __hash__ = _Nested.__hash__


@dataclass(frozen=True)
class Call(_Nested):
    """A function with its arguments."""

    function: str
    arguments: tuple["Node", ...]

    __hash__ = _Nested.__hash__


@dataclass(frozen=True)
class Sampled(_Nested):
    """The values of an expression where messages of a connection arrived."""

    connection: str
    argument: "Node"

    __hash__ = _Nested.__hash__


@dataclass(frozen=True)
class JobMeasure:
    """A measure of each job of a task: its response [s], or whether it missed its deadline."""

    what: str
    task: str


_IDENTIFIERS = re.compile(r"[^\W\d]\w*(\.[^\W\d]\w*|\[\d+(,\d+)*\])*")
"""A name that needs no quotes"""
Node: TypeAlias = Number | Name | Operation | Call | Sampled | JobMeasure


@functools.lru_cache(maxsize=1024)
def parse(text: str) -> Node:
    """The tree of an expression; raises `UsageError` naming what is not part of the language.

    A function over a measure of jobs is one number of the run, which no signal determines: a name with its text.
    """
    return _with_job_numbers(parse_job_measures(text))


@functools.lru_cache(maxsize=1024)
def parse_job_measures(text: str) -> Node:
    """As `parse`, with measures of jobs as nodes."""
    if not isinstance(text, str) or len(text) > MAX_EXPRESSION_LENGTH:
        raise UsageError(f"expected an expression of at most {MAX_EXPRESSION_LENGTH} characters")
    try:
        tree = parse_expression(text.strip())
    except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
        problem = error.msg if isinstance(error, SyntaxError) else type(error).__name__
        raise UsageError(f"{_short(text)}: expected an expression: {problem}") from None
    return _node(tree.body, text, 0)


def names_job_measure(name: str) -> bool:
    """Whether a name is the text of a function over a measure of jobs."""
    function, bracket, _ = name.partition("(")
    return bool(bracket) and function in REDUCTIONS


def has_job_measure(node: Node) -> bool:
    """Whether an expression contains a measure of jobs."""
    return isinstance(node, JobMeasure) or any(map(has_job_measure, children(node)))


def _with_job_numbers(node: Node) -> Node:
    match node:
        case JobMeasure():
            raise UsageError(f"{text(node)}: has a value for each job; expected it inside max, mean, share or the like")
        case Call() if is_over_run(node) and has_job_measure(node):
            return Name(text(node))
        case Operation(sign, operands):
            return Operation(sign, tuple(map(_with_job_numbers, operands)))
        case Call(function, arguments):
            return Call(function, tuple(map(_with_job_numbers, arguments)))
        case Sampled(connection, argument):
            return Sampled(connection, _with_job_numbers(argument))
    return node


@functools.lru_cache(maxsize=4096)
def names(node: Node) -> tuple[str, ...]:
    """Every name in an expression, once for each use."""
    own = (node.text,) if isinstance(node, Name) else ()
    return own + tuple(name for child in children(node) for name in names(child))


def text(node: Node) -> str:
    """The text of an expression."""
    match node:
        case Number(value):
            return f"{value:g}"
        case Name(name):
            return name if names_job_measure(name) or _IDENTIFIERS.fullmatch(name) else repr(name)
        case Sampled(connection, argument):
            return f"{SAMPLED}({connection}, {text(argument)})"
        case JobMeasure(what, task):
            return f"{what}({task})"
        case Call(function, arguments):
            return f"{function}({', '.join(map(text, arguments))})"
        case Operation("neg" | "not" as sign, (operand,)):
            return f"{'-' if sign == 'neg' else 'not '}{_bracketed(operand)}"
        case Operation(sign, operands):
            return f" {sign} ".join(map(_bracketed, operands))


def _bracketed(node: Node) -> str:
    return f"({text(node)})" if isinstance(node, Operation) else text(node)


def is_over_run(node: Call) -> bool:
    """Whether a call is a function over a whole run."""
    return node.function in REDUCTIONS and not (node.function in ("min", "max") and len(node.arguments) > 1)


def is_number(node: Node) -> bool:
    """Whether an expression is a number by its form, and so no condition."""
    match node:
        case Operation(sign):
            return not OPERATORS[sign].gives_truth
        case Call() | Sampled() | JobMeasure():
            return True
    return isinstance(node, Number) and node.value not in (0.0, 1.0)


def is_truth(node: Node) -> bool:
    """Whether an expression is a truth value by its form, and so no number."""
    return isinstance(node, Operation) and OPERATORS[node.sign].gives_truth


def parts(node: Node) -> Iterator[Node]:
    """The operands of and, or and not in a condition; itself if it has none."""
    if isinstance(node, Operation) and node.sign in ("and", "or", "not"):
        for operand in node.operands:
            yield from parts(operand)
    else:
        yield node


def children(node: Node) -> tuple[Node, ...]:
    """The direct subexpressions."""
    if isinstance(node, Operation):
        return node.operands
    if isinstance(node, Sampled):
        return (node.argument,)
    return node.arguments if isinstance(node, Call) else ()


_SIGNS = {operator.tree: word for word, operator in OPERATORS.items() if operator.tree is not None}


def _node(tree: ast.expr, text: str, depth: int) -> Node:
    if depth > MAX_NESTING:
        raise UsageError(f"{_short(text)}: expected an expression nested at most {MAX_NESTING} deep")
    build: Callable[[ast.expr], Node] = lambda child: _node(child, text, depth + 1)  # noqa: E731
    match tree:
        case ast.Constant(value=bool(value)):
            return Number(float(value))
        case ast.Constant(value=int() | float() as value):
            try:
                number = float(value)
            except OverflowError:
                number = math.inf
            if math.isinf(number):
                raise UsageError(f"{_short(text)}: expected numbers that a float can hold")
            return Number(number)
        case ast.Name() | ast.Attribute() | ast.Subscript():
            return Name(_dotted(tree, text))
        case ast.Constant(value=str(name)) if name and not names_job_measure(name):
            return Name(name)
        case ast.UnaryOp(op=ast.UAdd()):
            return build(tree.operand)
        case ast.UnaryOp(op=op) if type(op) in _SIGNS:
            return Operation(_SIGNS[type(op)], (build(tree.operand),))
        case ast.BinOp(op=op) if type(op) in _SIGNS:
            return Operation(_SIGNS[type(op)], (build(tree.left), build(tree.right)))
        case ast.BoolOp(op=op):
            return Operation(_SIGNS[type(op)], tuple(map(build, tree.values)))
        case ast.Compare() if all(type(op) in _SIGNS for op in tree.ops):
            sides = [build(side) for side in (tree.left, *tree.comparators)]
            pairs = [Operation(_SIGNS[type(op)], (left, right)) for op, left, right in zip(tree.ops, sides, sides[1:])]
            return pairs[0] if len(pairs) == 1 else Operation("and", tuple(pairs))
        case ast.Call(func=ast.Name(id="sampled"), args=[ast.Name(id=connection), argument], keywords=[]):
            return Sampled(connection, build(argument))
        case ast.Call(func=ast.Name(id="response" | "missed" as what), args=[task], keywords=[]):
            return JobMeasure(what, _dotted(task, text))
        case ast.Call(func=ast.Name(id=function), keywords=[]):
            arguments = tuple(map(build, tree.args))
            if function == "integral" and isinstance(arguments[0] if arguments else None, Sampled):
                raise UsageError(f"{_short(text)}: samples have no integral; expected integral of the signal itself")
            return Call(_checked_name(function, len(arguments), text), arguments)
    raise UsageError(
        f"{_short(text)}: {_short(ast.unparse(tree))} is not part of the language; expected numbers, names, "
        "+ - * / **, comparisons, and, or, not, and functions"
    )


def _dotted(tree: ast.expr, text: str) -> str:
    """COMPONENT.VARIABLE, also with indices as in `motor.u[1]`."""
    match tree:
        case ast.Name(id=name):
            return name
        case ast.Attribute(value=value, attr=attribute):
            return f"{_dotted(value, text)}.{attribute}"
        case ast.Subscript(value=value, slice=ast.Constant(value=int(index))):
            return f"{_dotted(value, text)}[{index}]"
        case ast.Subscript(value=value, slice=ast.Tuple(elts=elements)) if all(
            isinstance(e, ast.Constant) and isinstance(e.value, int) for e in elements
        ):
            return f"{_dotted(value, text)}[{','.join(str(e.value) for e in elements if isinstance(e, ast.Constant))}]"
    raise UsageError(f"{_short(text)}: {_short(ast.unparse(tree))}: expected the name of a signal")


def _checked_name(function: str, count: int, text: str) -> str:
    at_instant = {word: operator.arguments for word, operator in OPERATORS.items() if operator.tree is None}
    over_run = {word: reduction.arguments for word, reduction in REDUCTIONS.items()}
    functions = {**at_instant, **over_run, SAMPLED: (2, 2), **dict.fromkeys(JOB_MEASURES, (1, 1))}
    if function not in functions:
        expected = f"expected one of {', '.join(functions)}{did_you_mean(function, functions)}"
        raise UsageError(f"{_short(text)}: no function {function}; {expected}")
    fewest, most = functions[function]
    if not fewest <= count <= most:
        expected = str(fewest) if fewest == most else f"{fewest} or more"
        raise UsageError(f"{_short(text)}: {function} of {count} arguments; expected {expected}")
    return function


def _short(text: str) -> str:
    line = " ".join(str(text).split())
    return line if len(line) <= 80 else f"{line[:77]}..."
