"""Objectives: integrals are exact for held signals, and do not depend on the spans of a run."""

import itertools
import math
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from orchestration.foundation.basics.errors import UsageError
from orchestration.simulation.results.units import unit_of
from orchestration.systems.expressions.over_run import Recorded, evaluate, reductions
from orchestration.systems.expressions.reductions import REDUCTIONS
from orchestration.systems.expressions.syntax import parse
from tests.orchestration.systems.expressions.test_units import defined

TIME = np.array([0.0, 0.5, 1.0, 3.0])
LINEAR = np.array([0.0, 1.0, 2.0, 6.0])
HELD = np.array([1.0, -2.0, 3.0, 3.0])


def run_of(**changes) -> Recorded:
    fields = {
        "time": TIME,
        "signals": {"tank.level": LINEAR, "valve.u": HELD, "p.x": LINEAR, "p.y": LINEAR, "p.z": 0.0 * LINEAR},
        "ends": {"valve.u": HELD[:-1]},
        "numbers": {"tank.area": 2.0},
        "arrivals": {"command": np.array([True, False, True, True]), "never": np.zeros(4, dtype=bool)},
        "stop_time": 3.0,
    }
    return Recorded(**{**fields, **changes})


def value(expression: str, recorded: Recorded | None = None):
    whole = recorded or run_of()
    return evaluate({"x": parse(expression)}, lambda: iter([whole]))["x"]


METRE = defined("m", m=1)
UNITS = dict.fromkeys(("tank.level", "valve.u", "p.x", "p.y", "p.z"), METRE) | {"tank.area": METRE.power(Fraction(2))}
KNOWN = [
    ("max(tank.level)", 6.0, "m"),
    ("min(valve.u)", -2.0, "m"),
    ("first(tank.level)", 0.0, "m"),
    ("last(valve.u)", 3.0, "m"),
    ("mean(tank.level)", 3.0, "m"),
    ("integral(tank.level)", 9.0, "m.s"),
    ("integral(valve.u)", 0.5 * 1.0 + 0.5 * -2.0 + 2.0 * 3.0, "m.s"),
    ("integral(valve.u ** 2)", 0.5 * 1.0 + 0.5 * 4.0 + 2.0 * 9.0, "m2.s"),
    ("rms(valve.u)", math.sqrt((0.5 * 1.0 + 0.5 * 4.0 + 2.0 * 9.0) / 3.0), "m"),
    ("total_variation(valve.u)", 3.0 + 5.0, "m"),
    ("total_variation(tank.level)", 6.0, "m"),
    ("share(valve.u < 0)", 0.5 / 3.0, "1"),
    ("peak_time(valve.u)", 1.0, "s"),
    ("settling_time(valve.u - 3, 0.1)", 1.0, "s"),
    ("settling_time(tank.level, 10)", 0.0, "s"),
    ("settling_time(tank.level, 6)", 0.0, "s"),
    ("max(tank.level) / tank.area", 3.0, "1/m"),
    ("max(norm(p))", 6.0 * math.sqrt(2.0), "m"),
    ("max(norm(p - p))", 0.0, "m"),
    ("max(norm(p.x, p.y))", 6.0 * math.sqrt(2.0), "m"),
    ("mean(sampled(command, valve.u))", (1.0 + 3.0 + 3.0) / 3.0, "m"),
    ("share(sampled(command, valve.u > 2))", 2.0 / 3.0, "1"),
    ("growth_share(sampled(command, valve.u), 0.5)", 0.5, "1"),
    ("max(tank.level * (time >= stop_time / 2))", 6.0, "m"),
    ("max(max(tank.level, valve.u))", 6.0, "m"),
    ("max(tank.level) > 5 and not min(tank.level) > 0", 1.0, "1"),
]


@pytest.mark.parametrize(("expression", "expected", "unit"), KNOWN)
def test_functions_have_known_values_and_units(expression, expected, unit):
    assert value(expression) == pytest.approx(expected, rel=1e-14)
    found = unit_of(parse(expression), UNITS)
    assert str(found) == unit, (
        f"{expression} is in {found}: expected {unit}, as KNOWN has it, by `unit=` of its row of REDUCTIONS in "
        f"orchestration/systems/expressions/reductions.py"
    )


@pytest.mark.parametrize(
    "expression", ["settling_time(tank.level, 0.1)", "mean(sampled(never, valve.u))", "max(log(0 * tank.level - 1))"]
)
def test_an_expression_without_a_value_is_none(expression):
    assert value(expression) is None


def test_a_comparison_without_a_value_is_not_true():
    assert not value("settling_time(tank.level, 0.1) < 5")


def test_an_objective_may_name_one_above_it():
    found = evaluate({"peak": parse("max(tank.level)"), "good": parse("peak < 7")}, lambda: iter([run_of()]))
    assert found == {"peak": 6.0, "good": 1.0}


def test_along_a_first_order_hold_the_square_is_integrated_exactly():
    ends = np.array([2.0, -1.0, 5.0])  # just before the next rows
    whole = run_of(ends={"valve.u": ends})
    exact = sum(
        h * (a * a + a * b + b * b) / 3.0 for h, a, b in zip(np.diff(TIME), HELD[:-1], ends)
    )  # fmt: skip
    assert value("integral(valve.u ** 2)", whole) == pytest.approx(exact, rel=1e-14)
    assert value("max(valve.u)", whole) == 5.0


@pytest.mark.parametrize(
    ("expression", "complaint"),
    [
        ("tank.level", "expected one number of the run"),
        ("max(tank.depth)", "there is no tank.depth"),
        ("max(p)", "vector"),
        ("max(3)", "of a number; expected a signal"),
        ("mean(sampled(network, valve.u))", "expected the name of a connection: command, never"),
        ("max(sampled(command, valve.u)) + sampled(command, valve.u)", "expected inside"),
    ],
)
def test_an_invalid_expression_is_rejected_by_name(expression, complaint):
    with pytest.raises(UsageError, match=complaint) as error:
        value(expression)
    assert str(error.value).startswith("x = ")


EVERYTHING = {
    name: parse(expression)
    for name, expression in {
        "max": "max(a.x)", "min": "min(b.u)", "mean": "mean(a.x)", "rms": "rms(b.u)", "integral": "integral(a.x * b.u)",
        "tv": "total_variation(b.u)", "tv_linear": "total_variation(a.x)", "share": "share(b.u > 0)",
        "settles": "settling_time(a.x, 0.5)", "peak": "peak_time(a.x)", "first": "first(b.u)", "last": "last(a.x)",
        "at": "rms(sampled(c, a.x))", "grows": "growth_share(sampled(c, b.u), 0.1)", "nested": "share(a.x > mean(a.x))",
    }.items()
}  # fmt: skip


@pytest.mark.parametrize(
    ("nodes", "table"),
    [([parse(text) for text, *_ in KNOWN], "KNOWN"), ([*EVERYTHING.values()], "EVERYTHING")],
    ids=["with its value", "in spans"],
)
def test_every_reduction_is_tested(nodes, table):
    tested = {call.function for node in nodes for call in reductions(node)}
    assert tested == {*REDUCTIONS}, (
        f"{', '.join(tested ^ {*REDUCTIONS})}: expected a line of {table} in "
        f"tests/orchestration/systems/expressions/test_over_run.py"
    )


@given(st.integers(2, 40), st.lists(st.integers(1, 39), max_size=4), st.integers(0, 2**31))
def test_values_do_not_depend_on_the_spans_of_a_run(count, cuts, seed):
    random = np.random.default_rng(seed)
    time = np.cumsum(random.random(count) + 0.01)
    a, b, marks = random.normal(size=count), random.normal(size=count), random.random(count) < 0.5

    def spans(edges):
        for start, end in itertools.pairwise(edges):
            first = max(start - 1, 0)
            part = slice(first, end)
            yield Recorded(
                time=time[part], signals={"a.x": a[part], "b.u": b[part]}, ends={"b.u": b[part][:-1]},
                arrivals={"c": marks[part]}, stop_time=float(time[-1]), goes_on=start > 0,
            )  # fmt: skip

    edges = sorted({0, count, *(cut for cut in cuts if cut < count)})
    whole = evaluate(EVERYTHING, lambda: spans([0, count]))
    cut = evaluate(EVERYTHING, lambda: spans(edges))
    for name, expected in whole.items():
        assert cut[name] == (None if expected is None else pytest.approx(expected, rel=1e-12, abs=1e-12)), name
