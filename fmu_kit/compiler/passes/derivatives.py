"""Derivatives of a program by forward algorithmic differentiation of its graph: each value gets a tangent.

A tangent is the directional derivative of a value along one direction of the inputs. The functions with tangents do
what those of the program do; parameters, memory and results have tangents, conditions have none.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace
from typing import Any

from fmu_kit.compiler.trace.errors import TraceError
from fmu_kit.compiler.trace.statements import TANGENT, Block, Call, Function, Statement, statement
from fmu_kit.compiler.trace.symbols import Symbol, constant, lifted, node, select, unknown_below
from fmu_kit.compiler.trace.tracing import Program

Rule = Callable[[Symbol, tuple[Symbol, ...], tuple[Any, ...]], Any]
"""The tangent of a value, from the value, its operands and their tangents; None is zero"""


def tangent_place(name: str) -> str:
    """The name of the place with the tangent of a place."""
    return f"{TANGENT}{name}"


def with_tangents(program: Program, root: Function) -> Program:
    """The program that computes `root` and its derivatives, both as `initialise` and as `do_step`."""
    differentiation = _Differentiation(program)
    function = differentiation.function(root)
    return replace(
        program,
        functions=tuple(differentiation.functions),
        initialise=function,
        do_step=function,
        versions={**program.versions, **differentiation.versions},
    )


class _Differentiation:
    """Makes the functions with tangents."""

    def __init__(self, program: Program) -> None:
        self.program = program
        self.functions: list[Function] = []
        self.versions: dict[tuple[int, Statement], int] = {}
        self._made: dict[Function, Function] = {}

    def function(self, f: Function) -> Function:
        """`f` with tangents, which follow its parameters and its results."""
        if f not in self._made:
            body = _Body(self, f)
            self._made[f] = replace(
                f,
                name=tangent_place(f.name),
                parameters=(*f.parameters, *(body.tangent_of_parameter(p) for p in f.parameters)),
                names=(*f.names, *(tangent_place(name) for name in f.names)),
                body=body.block(f.body),
                results=2 * f.results,
                stores=f.stores | {tangent_place(name) for name in f.stores},
                doc=f"{f.doc.rstrip('.')}; with tangents.",
            )
            self.functions.append(self._made[f])
        return self._made[f]


class _Body:
    """Makes the body of one function with tangents."""

    def __init__(self, whole: _Differentiation, function: Function) -> None:
        self.whole = whole
        self.f = function
        self.loops: dict[Statement, Statement] = {}
        self._sizes: dict[int, int] = {}
        self._known: dict[int, tuple[Symbol, Any]] = {}

    # -- statements --------------------------------------------------------------------------------------------

    def block(self, block: Block) -> Block:
        """The statements of a block with those of the tangents."""
        return tuple(made for each in block for made in getattr(self, f"_{each.op}")(each))

    def _if(self, each: Statement) -> Iterable[Statement]:
        then, otherwise = map(self.block, each.blocks)
        return (statement("if", (self.value(each.symbols[0]),), None, (then, otherwise)),)

    def _assign(self, each: Statement) -> Iterable[Statement]:
        target, tangent = self.dual(each.symbols[0])
        value, its_tangent = self.dual(each.symbols[1])
        yield statement("assign", (target, value))
        if tangent is not None:
            yield statement("assign", (tangent, _number(its_tangent)))

    def _store(self, each: Statement) -> Iterable[Statement]:
        value, tangent = self.dual(each.symbols[0])
        yield statement("store", (value,), each.data)
        yield statement("store", (_number(tangent),), tangent_place(each.data))

    def _call(self, each: Statement) -> Iterable[Statement]:
        call: Call = each.data
        duals = [self.dual(symbol) for symbol in each.symbols]
        given = (*(value for value, _ in duals), *(_number(tangent) for _, tangent in duals))
        made = statement("call", given, Call(self.whole.function(call.function), call.memory))
        self.whole.versions[call.memory, made] = self.whole.program.versions[call.memory, each]
        return (made,)

    def _loop(self, each: Statement) -> Iterable[Statement]:
        size = (len(each.symbols) - 1) // 2
        starts = [self.dual(symbol) for symbol in each.symbols[1 : 1 + size]]
        outside, self._sizes[each.data] = dict(self._known), size
        body = self.block(each.blocks[0])
        nexts = [self.dual(symbol) for symbol in each.symbols[1 + size :]]
        self._known = outside  # the variables of another loop may have the same names
        symbols = [self.value(each.symbols[0])]
        for duals in (starts, nexts):
            symbols += [value for value, _ in duals]
            symbols += [_number(tangent) for _, tangent in duals]
        self.loops[each] = made = statement("loop", symbols, each.data, (body,))
        return (made,)

    def _warn(self, statement: Statement) -> Iterable[Statement]:
        return ()

    def _raise(self, each: Statement) -> Iterable[Statement]:
        return (statement("raise", [self.value(symbol) for symbol in each.symbols], each.data),)

    def _return(self, each: Statement) -> Iterable[Statement]:
        duals = [self.dual(symbol) for symbol in each.symbols]
        return (statement("return", (*(value for value, _ in duals), *(_number(t) for _, t in duals))),)

    # -- values ------------------------------------------------------------------------------------------------

    def value(self, symbol: Symbol) -> Symbol:
        """A symbol in the function with tangents."""
        return self.dual(symbol)[0]

    def dual(self, symbol: Symbol) -> tuple[Symbol, Any]:
        """A symbol and its tangent; None is zero."""
        for one in unknown_below(symbol, lambda each: id(each) in self._known):
            self._known[id(one)] = self._dual(one)
        return self._known[id(symbol)]

    def _dual(self, symbol: Symbol) -> tuple[Symbol, Any]:
        if not symbol.args:
            return self._leaf(symbol)
        args = tuple(self._known[id(arg)][0] for arg in symbol.args)
        tangents = tuple(self._known[id(arg)][1] for arg in symbol.args)
        value = node(symbol.op, args, symbol.kind, symbol.data)
        if symbol.kind != "real" or all(tangent is None for tangent in tangents):
            return value, None
        return value, _RULES[symbol.op](value, args, tangents)

    def _leaf(self, symbol: Symbol) -> tuple[Symbol, Any]:
        data = symbol.data
        if symbol.op == "outcome":
            k, loop = data
            size = (len(loop.symbols) - 1) // 2
            if loop not in self.loops:  # in a later branch
                self._loop(loop)
            made = self.loops[loop]
            value = node("outcome", (), symbol.kind, (k, made))
            return value, node("outcome", (), "real", (k + size, made)) if symbol.kind == "real" else None
        if symbol.kind != "real" or symbol.op == "constant":
            return symbol, None
        if symbol.op == "parameter":
            return symbol, self.tangent_of_parameter(symbol)
        if symbol.op == "load":
            return symbol, node("load", (), "real", (tangent_place(data[0]), data[1]))
        if symbol.op == "result":
            count = self._results_of(data[1])
            return symbol, node("result", (), "real", (data[0] + count, data[1]))
        if symbol.op == "variable":
            depth, k = data
            return symbol, node("variable", (), "real", (depth, k + self._sizes[depth]))
        return symbol, None

    def _results_of(self, version: int) -> int:
        for (_, call), after in self.whole.program.versions.items():
            if after == version:
                return int(call.data.function.results)
        raise TraceError("a result of no call")

    def tangent_of_parameter(self, symbol: Symbol) -> Symbol:
        """The parameter that is the tangent of another."""
        return node("parameter", (), "real", symbol.data + len(self.f.parameters))


def _number(tangent: Any) -> Symbol:
    return constant(0.0) if tangent is None else lifted(tangent)


# -- the rules of the operations: values are symbols, tangents are symbols or None ------------------------------------


def _plus(a: Any, b: Any) -> Any:
    return b if a is None else a if b is None else node("add", (a, b), "real")


def _times(tangent: Any, factor: Any) -> Any:
    return None if tangent is None else node("mul", (tangent, lifted(factor)), "real")


def _over(tangent: Any, divisor: Symbol) -> Any:
    return None if tangent is None else node("div", (tangent, divisor), "real")


def _negative(tangent: Any) -> Any:
    return None if tangent is None else node("neg", (tangent,), "real")


def _of(name: str, *args: Symbol) -> Symbol:
    return node(name, args, "real")


def _by(slope: Callable[[Symbol, Symbol], Any]) -> Rule:
    """The rule of a function of one operand; `slope` computes its derivative from result and operand."""
    return lambda y, x, d: _times(d[0], slope(y, x[0]))


def _minus(a: Any, b: Any) -> Symbol:
    return node("sub", (lifted(a), lifted(b)), "real")


def _square(a: Symbol) -> Symbol:
    return node("mul", (a, a), "real")


def _sign(x: Symbol) -> Symbol:
    return _of("copysign", constant(1.0), x)


def _root_of_complement(x: Symbol) -> Symbol:
    """sqrt(1 - x²)."""
    return _of("sqrt", _minus(1.0, _square(x)))


def _power(y: Symbol, x: tuple[Symbol, ...], d: tuple[Any, ...]) -> Any:
    base, exponent = x
    by_base = None
    if d[0] is not None:
        by_base = _times(d[0], node("mul", (exponent, _of("pow", base, _minus(exponent, 1.0))), "real"))
    return _plus(by_base, _times(d[1], node("mul", (y, _of("log", base)), "real")) if d[1] is not None else None)


def _chosen(y: Symbol, x: tuple[Symbol, ...], d: tuple[Any, ...]) -> Any:
    return select(x[0], _number(d[1]), _number(d[2]))


def _joined(y: Symbol, x: tuple[Symbol, ...], d: tuple[Any, ...]) -> Any:
    return node("phi", (x[0], _number(d[1]), _number(d[2])), "real")


def _direction(y: Symbol, x: tuple[Symbol, ...], d: tuple[Any, ...]) -> Any:
    """The tangent of atan2(a, b): (b da - a db) / (a² + b²)."""
    a, b = x
    size = node("add", (_square(a), _square(b)), "real")
    return _over(_plus(_times(d[0], b), _negative(_times(d[1], a))), size)


_RULES: dict[str, Rule] = {
    "add": lambda y, x, d: _plus(d[0], d[1]),
    "sub": lambda y, x, d: _plus(d[0], _negative(d[1])),
    "mul": lambda y, x, d: _plus(_times(d[0], x[1]), _times(d[1], x[0])),
    "div": lambda y, x, d: _over(_plus(d[0], _negative(_times(d[1], y))), x[1]),
    "mod": lambda y, x, d: _plus(d[0], _negative(_times(d[1], _of("floor", node("div", x, "real"))))),
    "floor": lambda y, x, d: None,
    "ceil": lambda y, x, d: None,
    "pow": _power,
    "neg": lambda y, x, d: _negative(d[0]),
    "abs": _by(lambda y, x: _sign(x)),
    "copysign": lambda y, x, d: _times(_times(d[0], _sign(y)), _sign(x[0])),
    "select": _chosen,
    "phi": _joined,
    "sqrt": lambda y, x, d: _over(d[0], node("mul", (constant(2.0), y), "real")),
    "exp": _by(lambda y, x: y),
    "expm1": _by(lambda y, x: node("add", (y, constant(1.0)), "real")),
    "log": lambda y, x, d: _over(d[0], x[0]),
    "sin": _by(lambda y, x: _of("cos", x)),
    "cos": _by(lambda y, x: node("neg", (_of("sin", x),), "real")),
    "tan": _by(lambda y, x: node("add", (constant(1.0), _square(y)), "real")),
    "tanh": _by(lambda y, x: _minus(1.0, _square(y))),
    "asin": lambda y, x, d: _over(d[0], _root_of_complement(x[0])),
    "acos": lambda y, x, d: _negative(_over(d[0], _root_of_complement(x[0]))),
    "atan": lambda y, x, d: _over(d[0], node("add", (constant(1.0), _square(x[0])), "real")),
    "atan2": _direction,
}  # fmt: skip
