"""Units are read from their names, in any combination of SI symbols."""

import pytest

from fmu_kit.units import base_unit_exponents


@pytest.mark.parametrize(
    ("name", "exponents"),
    [
        ("1", {}),
        ("N.m", {"kg": 1, "m": 2, "s": -2}),
        ("kg.m2", {"kg": 1, "m": 2}),
        ("1/s2", {"s": -2}),
        ("m/s", {"m": 1, "s": -1}),
        ("rad/s", {"rad": 1, "s": -1}),
        ("N.m.s", {"kg": 1, "m": 2, "s": -1}),
        ("J/(kg.K)", {"m": 2, "s": -2, "K": -1}),
        ("V.s/rad", {"kg": 1, "m": 2, "s": -2, "A": -1, "rad": -1}),
        ("m-3.mol", {"m": -3, "mol": 1}),
        ("Ohm.A/V", {}),
        ("s/s", {}),
    ],
)
def test_a_name_is_a_product_of_powers_of_base_units(name: str, exponents: dict[str, int]) -> None:
    assert base_unit_exponents(name) == exponents


@pytest.mark.parametrize(
    "name", ["", "furlong", "m/s.s", "m//s", "m/s/s", "km", "m^2", "m 2", "N*m", "2/s", "/s", "m/"]
)
def test_what_is_no_such_name_is_refused_by_name(name: str) -> None:
    with pytest.raises(ValueError, match=r"^unit .*: expected "):
        base_unit_exponents(name)
