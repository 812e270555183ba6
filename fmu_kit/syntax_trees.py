"""Syntax trees of sources, one thread at a time.

In CPython 3.11 the parser counts how deep it is for the whole interpreter: two threads that parse at once now and
then end in a SystemError.
"""

import ast
import threading
from collections import deque
from collections.abc import Iterator

_ONE_AT_A_TIME = threading.Lock()


def parsed(source: str | bytes, name: str = "<unknown>") -> ast.Module:
    """The tree of a module; raises what `ast.parse` does."""
    with _ONE_AT_A_TIME:
        return ast.parse(source, name)


def statements(tree: ast.Module) -> Iterator[ast.AST]:
    """Every statement of a module, those within others too, as `ast.walk` has them; without the many expressions."""
    waiting: deque[ast.AST] = deque(tree.body)
    while waiting:
        node = waiting.popleft()
        yield node
        for within in ("body", "handlers", "cases", "orelse", "finalbody"):
            waiting += getattr(node, within, ())


def parsed_expression(source: str) -> ast.Expression:
    """The tree of an expression; raises what `ast.parse` does."""
    with _ONE_AT_A_TIME:
        return ast.parse(source, mode="eval")
