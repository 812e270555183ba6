"""Parsing of Python sources, in one thread at a time.

In CPython 3.11 the parser counts its depth for the whole interpreter: when two threads parse at once, this sometimes
raises a SystemError.
"""

import ast
import threading
from collections import deque
from collections.abc import Iterator

_ONE_AT_A_TIME = threading.Lock()


def parse_module(source: str | bytes, name: str = "<unknown>") -> ast.Module:
    """The tree of a module; raises what `ast.parse` does."""
    with _ONE_AT_A_TIME:
        return ast.parse(source, name)


def statements(tree: ast.Module) -> Iterator[ast.AST]:
    """Every statement of a module, nested ones included, in the order of `ast.walk`, without visiting expressions."""
    waiting: deque[ast.AST] = deque(tree.body)
    while waiting:
        node = waiting.popleft()
        yield node
        for within in ("body", "handlers", "cases", "orelse", "finalbody"):
            waiting += getattr(node, within, ())


def parse_expression(source: str) -> ast.Expression:
    """The tree of an expression; raises what `ast.parse` does."""
    with _ONE_AT_A_TIME:
        return ast.parse(source, mode="eval")
