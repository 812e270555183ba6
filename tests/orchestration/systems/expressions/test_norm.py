"""The norm is one number, wherever it is computed: at an instant, over rows, and in lanes."""

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from orchestration.simulation.engines.batch.writing import ExpressionWriter, Leaf, Section
from orchestration.systems.expressions.at_instant import compiled, scalars
from orchestration.systems.expressions.over_run import Recorded, evaluate
from orchestration.systems.expressions.syntax import Call, Node, parse

PLACES = {"p.x": 0, "p.y": 1, "p.z": 2, "v": 3}
VECTORS = {"p": ("p.x", "p.y", "p.z")}
NUMBERS = st.floats(-1e3, 1e3)


def over_rows(node: Node, values: tuple[float, ...]) -> float:
    """As in metrics."""
    signals = {name: np.array([values[place]] * 2) for name, place in PLACES.items()}
    run = Recorded(time=np.array([0.0, 1.0]), signals=signals, ends={}, numbers={}, arrivals={}, stop_time=1.0)
    found = evaluate({"x": Call("max", (node,))}, lambda: iter([run]))["x"]
    assert found is not None
    return found


def in_lanes(node: Node, values: tuple[float, ...]) -> float:
    """As in the C for SIMD lanes, read as Python."""
    writer = ExpressionWriter({name: Leaf(code=f"v{place}", kind="held") for name, place in PLACES.items()}, {})
    (one,) = scalars(node, VECTORS)
    section = Section("x")
    name = writer.value(one, "row", section)
    known: dict[str, Any] = {"q_sqrt": math.sqrt, **{f"v{place}": value for place, value in enumerate(values)}}
    for line in section.lines:
        of, _, code = line.removeprefix("const q_real ").rstrip(";").partition(" = ")
        known[of] = eval(code, known)
    return float(known[name])


@pytest.mark.parametrize(
    "expression", ["norm(p)", "norm(v, p)", "norm(p, v)", "hypot(v, p.x)", "norm(p, 2 * p)", "norm(v)"]
)
@given(values=st.tuples(NUMBERS, NUMBERS, NUMBERS, NUMBERS))
def test_the_norm_has_the_same_bits_everywhere(expression: str, values: tuple[float, ...]) -> None:
    node = parse(expression)
    at_once = compiled(node, PLACES)(values)
    assert at_once == over_rows(node, values)
    if "2" not in expression:
        assert at_once == in_lanes(node, values)


def test_a_condition_at_its_edge_has_the_same_value_everywhere() -> None:
    values = (2.507, 2.044, 0.98, 0.0)
    assert math.hypot(*values) > 3.379849848735887
    assert not compiled(parse("norm(p) > 3.379849848735887"), PLACES)(values)
    assert over_rows(parse("norm(p)"), values) == 3.379849848735887
