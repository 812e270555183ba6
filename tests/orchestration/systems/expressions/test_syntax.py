"""The grammar: what is part of the language, and that nothing else ever runs."""

import math
import pickle

import pytest
from hypothesis import given
from hypothesis import strategies as st

from orchestration.foundation.basics.errors import UsageError
from orchestration.systems.expressions.syntax import (
    Call,
    Name,
    Number,
    Operation,
    Sampled,
    names,
    names_job_measure,
    parse,
    text,
)


def test_arithmetic_binds_as_in_python():
    assert parse("1 + 2 * a.b ** 2") == Operation(
        "+", (Number(1.0), Operation("*", (Number(2.0), Operation("**", (Name("a.b"), Number(2.0))))))
    )


def test_a_chain_of_comparisons_is_their_conjunction():
    assert parse("0 < x.y <= 1") == parse("0 < x.y and x.y <= 1")


def test_an_element_of_an_array_is_a_name():
    assert parse("max(motor.u[1])") == Call("max", (Name("motor.u[1]"),))
    assert parse("motor.u[1, 2]") == Name("motor.u[1,2]")


def test_a_name_of_other_characters_is_in_quotes():
    assert parse('max("ball.der(h)")') == Call("max", (Name("ball.der(h)"),))
    assert not names_job_measure("ball.der(h)")


def test_samples_have_no_integral():
    with pytest.raises(UsageError, match=r"^integral\(sampled\(c, a.x\)\): samples have no integral"):
        parse("integral(sampled(c, a.x))")


def test_sampled_names_a_connection_not_a_signal():
    tree = parse("rms(sampled(measurement, controller.e))")
    assert tree == Call("rms", (Sampled("measurement", Name("controller.e")),))
    assert list(names(tree)) == ["controller.e"]


@pytest.mark.parametrize(
    "source",
    [
        "__import__('os')", "().__class__", "[x for x in y]", "lambda: 1", "a if b else c", "f'{x}'", "x := 1",
        "open('f')", "max(x, key=1)", "max(*x)", "a @ b", "a // b", "a & b", "{}", "''", "'max(x)'", "x.y()", "1j",
        "...", "x[0:1]", "x['a']", "await x", "x is y", "x in y", "",
    ],
)  # fmt: skip
def test_what_is_not_part_of_the_language_is_rejected_in_one_line(source):
    with pytest.raises(UsageError) as error:
        parse(source)
    assert "\n" not in str(error.value)
    assert "expected" in str(error.value)


def test_the_nearest_name_is_proposed_for_a_misspelt_function():
    with pytest.raises(UsageError, match=r"no function maxx; expected one of .*did you mean max"):
        parse("maxx(a.b)")


def test_a_wrong_number_of_arguments_is_rejected():
    with pytest.raises(UsageError, match="settling_time of 1 arguments; expected 2"):
        parse("settling_time(a.b)")


def test_an_expression_that_is_nested_too_deeply_is_rejected():
    with pytest.raises(UsageError, match="nested"):
        parse("-" * 200 + "1")
    with pytest.raises(UsageError, match="expected"):
        parse("(" * 5000 + "1" + ")" * 5000)


@pytest.mark.parametrize("number", ["1" + "0" * 400, "1e999", "max(x) < 1e999"])
def test_a_number_beyond_the_range_of_floats_is_rejected(number):
    with pytest.raises(UsageError, match="float"):
        parse(number)


@given(st.text(max_size=60))
def test_any_text_is_an_expression_or_wrong_usage(source):
    try:
        tree = parse(source)
    except UsageError:
        return
    assert _flat(parse(text(tree))) == _flat(tree)


_trees = st.recursive(
    st.one_of(
        st.floats(0, 1e6, allow_nan=False).map(lambda v: Number(float(f"{v:g}"))),
        st.sampled_from([Name("a.b"), Name("c.u[1]"), Name("peak"), Name("ball.der(h)"), Name("c.it's 1st")]),
    ),
    lambda inner: st.one_of(
        st.tuples(st.sampled_from("+-*/"), inner, inner).map(lambda t: Operation(t[0], t[1:])),
        st.tuples(st.sampled_from(["<", ">=", "and", "or"]), inner, inner).map(lambda t: Operation(t[0], t[1:])),
        inner.map(lambda x: Operation("neg", (x,))),
        inner.map(lambda x: Call("max", (x,))),
    ),
    max_leaves=8,
)


@given(_trees)
def test_the_text_of_an_expression_reads_as_the_same_expression(tree):
    assert _flat(parse(text(tree))) == _flat(tree)


def _flat(node):
    """`a and (b and c)` is written with brackets, and one side of a comparison may be a comparison."""
    if isinstance(node, Operation):
        return Operation(node.sign, tuple(map(_flat, node.operands)))
    if isinstance(node, Call):
        return Call(node.function, tuple(map(_flat, node.arguments)))
    return node if not isinstance(node, Number) or not math.isnan(node.value) else Number(0.0)


def test_the_cached_hash_of_an_expression_is_not_pickled():
    node = parse("max(norm(a, b))")
    assert {node: 1}[parse("max(norm(a, b))")] == 1
    there = pickle.loads(pickle.dumps(node))
    assert (there, vars(there).keys()) == (node, {"function", "arguments"})
