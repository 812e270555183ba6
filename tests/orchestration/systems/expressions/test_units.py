"""Units of expressions: of products, integrals and functions; incompatible units."""

from fractions import Fraction

import pytest

from fmu_kit.units import BASE
from orchestration.foundation.basics.errors import UsageError
from orchestration.foundation.basics.unit_algebra import BaseUnits, Unit, named
from orchestration.simulation.results.units import unit_of
from orchestration.systems.expressions.syntax import parse


def defined(name: str, factor: float = 1.0, offset: float = 0.0, **exponents: int) -> Unit:
    powers = tuple(Fraction(exponents.get(key, 0)) for key in BASE)
    return named(name, BaseUnits(exponents=powers, factor=factor, offset=offset))


UNITS = {
    "p.x": defined("m", m=1),
    "p.v": defined("m/s", m=1, s=-1),
    "p.mm": defined("mm", factor=1e-3, m=1),
    "p.angle": defined("rad", rad=1),
    "p.degrees": defined("deg", factor=0.0174532925199433, rad=1),
    "p.rate": defined("rad/s", rad=1, s=-1),
    "p.hertz": defined("Hz", s=-1),
    "p.torque": defined("N.m", kg=1, m=2, s=-2),
    "p.power": defined("W", kg=1, m=2, s=-3),
    "p.kilowatt": defined("kW", factor=1e3, kg=1, m=2, s=-3),
    "p.celsius": defined("degC", offset=273.15, K=1),
    "p.kelvin": defined("K", K=1),
    "p.ratio": defined("1"),
    "p.bits": named("bits", None),
    "p.bytes": named("bytes", None),
    "p.plain": None,
    "p.a.x": defined("m", m=1),
    "p.a.y": defined("m", m=1),
    "p.b.x": defined("m", m=1),
    "p.b.y": defined("rad", rad=1),
}


def unit(expression: str) -> str | None:
    found = unit_of(parse(expression), UNITS)
    return None if found is None else str(found)


@pytest.mark.parametrize(
    ("expression", "expected"),
    [
        ("max(p.x)", "m"),
        ("rms(p.x - last(p.x))", "m"),
        ("norm(p.a)", "m"),
        ("hypot(p.x, p.a.x)", "m"),
        ("total_variation(p.torque) / 2", "N.m"),
        ("integral(p.v)", "m"),
        ("integral(p.power)", "J"),
        ("integral(p.kilowatt)", "kW.s"),
        ("integral(time * p.x ** 2)", "m2.s2"),
        ("integral(p.torque ** 2)", "N2.m2.s"),
        ("sqrt(p.x)", "m^(1/2)"),
        ("sqrt(mean(p.x ** 2))", "m"),
        ("p.x ** -1 / p.v", "s/m2"),
        ("1 / p.x", "1/m"),
        ("p.x / (p.v * p.torque)", "s/(m.N)"),
        ("settling_time(p.x, 0.05)", "s"),
        ("peak_time(p.torque)", "s"),
        ("stop_time - time", "s"),
        ("share(p.x > 1)", "1"),
        ("growth_share(p.torque, 0.1)", "1"),
        ("p.x > 1 and not p.plain", "1"),
        ("2 * acos(min(1, abs(p.ratio)))", "rad"),
        ("atan2(p.x, p.a.x)", "rad"),
        ("sin(p.angle)", "1"),
        ("tanh(p.x / p.a.x)", "1"),
        ("max(sampled(bus, p.x))", "m"),
        ("p.x * (time > stop_time / 2)", "m"),
        ("-p.x + 3", "m"),
    ],
)
def test_a_unit_is_computed(expression: str, expected: str) -> None:
    assert unit(expression) == expected


@pytest.mark.parametrize("expression", ["p.plain", "max(p.x * p.plain)", "p.x + p.plain", "integral(p.plain)"])
def test_where_one_signal_has_none_the_result_has_none(expression: str) -> None:
    assert unit(expression) is None


@pytest.mark.parametrize(
    ("expression", "message"),
    [
        ("p.x + p.v", "+: p.x is in m, p.v is in m/s; expected one unit, or a number as a factor"),
        ("p.x < p.torque", "<: p.x is in m, p.torque is in N.m; "),
        ("max(p.x, 1, p.v)", "max: p.x is in m, p.v is in m/s; "),
        ("p.x - p.mm", "-: p.x is in m, p.mm is in mm; "),
        ("p.plain + p.x + p.v > p.x - p.v", "-: p.x is in m, p.v is in m/s; "),
        ("min(p.plain, p.x, p.v)", "min: p.x is in m, p.v is in m/s; "),
        ("p.celsius < p.kelvin", "<: p.celsius is in degC, p.kelvin is in K; "),
        ("settling_time(p.x, p.v)", "settling_time: p.x is in m, p.v is in m/s; "),
        ("norm(p.b)", "p.b: p.b.x is in m, p.b.y is in rad; "),
        ("integral(p.x ** 2 + p.v ** 2)", "+: p.x ** 2 is in m2, p.v ** 2 is in m2/s2; "),
        ("sin(p.x)", "sin of p.x, which is in m; expected 1 or rad, or a factor"),
        ("cos(p.degrees)", "cos of p.degrees, which is in deg; expected 1 or rad, or a factor"),
        ("atan2(p.x, p.v)", "atan2: p.x is in m, p.v is in m/s; "),
        ("atan2(p.ratio, p.x)", "atan2: p.ratio is in 1, p.x is in m; "),
        ("exp(time)", "exp of time, which is in s; expected 1 or rad, or a factor"),
        ("p.x ** p.ratio", "p.ratio is the exponent of p.x, which is in m; expected a number"),
    ],
)
def test_incompatible_units_are_rejected_with_both_units(expression: str, message: str) -> None:
    with pytest.raises(UsageError) as refused:
        unit(expression)
    assert str(refused.value).startswith(message)


def test_a_number_as_a_factor_is_compatible_with_any_unit() -> None:
    assert unit("p.x + 0.5 * p.v") == "m"
    assert unit("integral(p.x ** 2 + 0.1 * p.torque ** 2)") == "m2.s"
    assert unit("p.mm * 0.001 < p.x") == "1"
    assert unit("2 * p.x + 3 * p.v") is None
    assert unit("2 * p.x + 3 * p.x - 1") == "m"
    assert unit("sin(6.28 * time) * exp(-time / 2)") == "1"


def test_rad_is_1_where_units_are_compared() -> None:
    assert unit("p.angle + p.ratio") == unit("p.ratio + p.angle") == "rad"
    assert unit("p.rate - p.hertz") == "rad/s"
    assert unit("p.rate * p.x < p.v") == "1"


def test_a_unit_that_no_fmu_defines_is_compared_by_name() -> None:
    assert unit("p.bits + p.bits") == "bits"
    assert unit("integral(p.bits ** 2)") == "bits2.s"
    assert unit("p.bits + p.bytes") is None
    assert unit("exp(p.bits)") == "1"


def test_a_difference_of_temperatures_keeps_its_name() -> None:
    assert unit("max(p.celsius) - min(p.celsius)") == "degC"


@pytest.mark.parametrize("name", ["m/s/s", "m^(1/2)", "W/m.K", "10 cm"])
def test_a_name_that_is_no_plain_product_is_kept_whole(name: str) -> None:
    assert str(named(name, None)) == name
    assert str(named(name, None).power(Fraction(2))) == f"({name})2"


@pytest.mark.parametrize("name", ["N.m", "m/s2", "W/(m2.K)", "1/s", "kg.m2", "rev/min"])
def test_a_plain_product_is_written_as_it_was(name: str) -> None:
    assert str(named(name, None)) == name
    assert named("m/s^2", None) == named("m/s2", None)


def test_the_unit_of_a_deep_expression_is_computed_once() -> None:
    text = "p.x"
    for _ in range(29):
        text = f"-({text} + 1)"
    assert unit(text) == "m"
