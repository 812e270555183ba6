"""An operator has the same value at an instant and over the rows of a run."""

import math
from itertools import product

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from orchestration.systems.expressions.at_instant import compiled
from orchestration.systems.expressions.operators import OPERATORS
from orchestration.systems.expressions.over_run import Recorded, SpanValues
from orchestration.systems.expressions.syntax import MAX_NESTING, Call, Name, Node, Number, Operation, parse

PLACES = {"a": 0, "b": 1}
SIGNS = [word for word, made in OPERATORS.items() if made.tree is not None]
TRUTHS = [word for word in SIGNS if OPERATORS[word].gives_truth]
EXACT = [word for word in SIGNS if word not in ("/", "**")]
"""Operators that IEEE 754 rounds, and that are defined for all numbers"""


def both(node: Node, a: float, b: float) -> tuple[float, float]:
    """The value at an instant, and at both rows of a run."""
    run = Recorded(time=np.array([0.0, 1.0]), signals={"a": np.full(2, a), "b": np.full(2, b)}, stop_time=1.0)
    with np.errstate(all="ignore"):
        rows = np.broadcast_to(SpanValues(run, {}).at_rows(node), (2,))
    assert rows[0] == rows[1] or math.isnan(rows[0])
    return compiled(node, PLACES)((a, b)), float(rows[0])


def of(word: str, *operands: Node) -> Node:
    """The operator, of as many of the operands as it takes."""
    if OPERATORS[word].tree is None:
        return Call(word, operands[: min(2, OPERATORS[word].arguments[1])])
    return Operation(word, operands[: 1 if word in ("neg", "not") else 2])


@given(a=st.floats(0.01, 0.99), b=st.floats(0.01, 0.99))
def test_an_operator_is_the_same_at_an_instant_and_over_a_run(a: float, b: float) -> None:
    for word in OPERATORS:
        at_once, over_rows = both(of(word, Name("a"), Name("b")), a, b)
        assert at_once == pytest.approx(over_rows, rel=0.0 if word in EXACT else 1e-14, abs=0.0), word


@pytest.mark.parametrize("word", TRUTHS)
def test_a_truth_value_is_0_or_1(word: str) -> None:
    for a, b in product((0.0, -0.0, 1.0, 2.5, -3.0, math.nan, math.inf), (0.0, 1.0, 2.5, math.nan)):
        assert set(both(of(word, Name("a"), Name("b")), a, b)) in ({0.0}, {1.0})


_trees: st.SearchStrategy[Node] = st.recursive(
    st.sampled_from([Name("a"), Name("b"), Number(0.0), Number(1.0), Number(2.5)]),
    lambda inner: st.builds(of, st.sampled_from(EXACT), inner, inner),
    max_leaves=12,
)


@example(tree=parse("-(a < b)"), a=1.0, b=0.0)
@given(tree=_trees, a=st.floats(-3, 3), b=st.floats(-3, 3))
def test_nested_operators_have_the_same_bits(tree: Node, a: float, b: float) -> None:
    at_once, over_rows = both(tree, a, b)
    assert np.float64(at_once).tobytes() == np.float64(over_rows).tobytes()


@pytest.mark.parametrize("inner", ["-", "norm(", "(a < a < ", "max(b, ", "1 / ("])
def test_the_deepest_expression_has_a_value_at_an_instant(inner: str) -> None:
    depth = MAX_NESTING - 1
    node = parse(inner * depth + "a" + ")" * inner.count("(") * depth)
    at_once, over_rows = both(node, 0.5, 0.25)
    assert at_once == over_rows
