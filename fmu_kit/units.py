"""Names of units, such as `N.m`, `kg.m2`, `1/s2`, `V.s/rad`, `W/(m2.K)`, and their meaning in SI base units.

A name is a product of symbols with whole exponents, divided by one symbol or by a product in parentheses.
"""

import math
import re
from collections.abc import Mapping

BASE = ("kg", "m", "s", "A", "K", "mol", "cd", "rad")
"""Base units by their names in FMI, in its order."""

SYMBOLS: dict[str, dict[str, int]] = {
    "1": {},
    **{symbol: {symbol: 1} for symbol in BASE},
    "N": {"kg": 1, "m": 1, "s": -2},
    "Pa": {"kg": 1, "m": -1, "s": -2},
    "J": {"kg": 1, "m": 2, "s": -2},
    "W": {"kg": 1, "m": 2, "s": -3},
    "C": {"s": 1, "A": 1},
    "V": {"kg": 1, "m": 2, "s": -3, "A": -1},
    "F": {"kg": -1, "m": -2, "s": 4, "A": 2},
    "Ohm": {"kg": 1, "m": 2, "s": -3, "A": -2},
    "S": {"kg": -1, "m": -2, "s": 3, "A": 2},
    "Wb": {"kg": 1, "m": 2, "s": -2, "A": -1},
    "T": {"kg": 1, "s": -2, "A": -1},
    "H": {"kg": 1, "m": 2, "s": -2, "A": -2},
    "Hz": {"s": -1},
}
"""Symbols whose unit is a product of base units without a factor."""

QUANTITIES = {
    "m": "Length",
    "m/s": "Velocity",
    "m/s2": "Acceleration",
    "m/s3": "Jerk",
    "rad": "Angle",
    "rad/s": "AngularVelocity",
    "rad/s2": "AngularAcceleration",
    "kg": "Mass",
    "kg.m2": "MomentOfInertia",
    "kg/m3": "Density",
    "N": "Force",
    "N.m": "Torque",
    "s": "Time",
    "Hz": "Frequency",
    "m2": "Area",
    "m3": "Volume",
    "m3/s": "VolumeFlowRate",
    "kg/s": "MassFlowRate",
    "Pa": "Pressure",
    "J": "Energy",
    "W": "Power",
    "K": "ThermodynamicTemperature",
    "A": "ElectricCurrent",
    "V": "ElectricPotential",
    "C": "ElectricCharge",
    "Ohm": "Resistance",
    "S": "Conductance",
    "F": "Capacitance",
    "H": "Inductance",
    "Wb": "MagneticFlux",
    "T": "MagneticFluxDensity",
    "mol": "AmountOfSubstance",
    "cd": "LuminousIntensity",
}
"""The quantity of a unit if none is given, by its name in `Modelica.Units.SI`."""

_DEGREES = math.degrees(1.0)
DISPLAYED = {"rad": ("deg", _DEGREES), "rad/s": ("deg/s", _DEGREES), "rad/s2": ("deg/s2", _DEGREES)}
"""The display unit of a unit, and its factor: how many of it make one of that unit."""


def factors(name: str) -> dict[str, int]:
    """The symbols in a name, whatever they mean, with their non-zero exponents; also of one with `*` and `^`.

    Raises `ValueError` for a name that is no such product.
    """
    above, slash, below = name.partition("/")
    if below.startswith("(") and below.endswith(")"):
        below = below[1:-1]
    elif "." in below:
        raise ValueError(f"unit {name}: expected parentheses around what is divided by")
    exponents: dict[str, int] = {}
    for sign, product in ((1, above), (-1, below)) if slash else ((1, above),):
        for factor in re.split(r"[.*]", product):
            parts = re.fullmatch(r"([^\W\d_]+|%|°|1)\^?(-?\d+)?", factor)
            if parts is None:
                raise ValueError(f"unit {name}: expected powers of symbols as in N.m, kg.m2 or W/(m2.K)")
            if parts[1] != "1":
                exponents[parts[1]] = exponents.get(parts[1], 0) + sign * int(parts[2] or 1)
    return {symbol: exponent for symbol, exponent in exponents.items() if exponent}


def base_unit_exponents(name: str, symbols: Mapping[str, Mapping[str, int]] = SYMBOLS) -> dict[str, int]:
    """The non-zero exponents of the SI base units; raises `ValueError` for a name that is not made of `symbols`."""
    named = factors(name)
    if not named.keys() <= symbols.keys() or re.search(r"[*^]", name):
        raise ValueError(f"unit {name}: expected powers of {', '.join(symbols)} as in N.m, kg.m2 or W/(m2.K)")
    total = dict.fromkeys(BASE, 0)
    for symbol, exponent in named.items():
        for base, power in symbols[symbol].items():
            total[base] += exponent * power
    return {base: exponent for base, exponent in total.items() if exponent}
