"""Units by name, in SI: `N.m`, `kg.m2`, `1/s2`, `V.s/rad`, `W/(m2.K)`, resolved to base units for `UnitDefinitions`.

Used when an FMU is built. A name is a product of symbols with whole exponents, divided by one symbol or by a product
in parentheses.
"""

import math
import re

SYMBOLS: dict[str, dict[str, int]] = {
    "1": {},
    "kg": {"kg": 1},
    "m": {"m": 1},
    "s": {"s": 1},
    "A": {"A": 1},
    "K": {"K": 1},
    "mol": {"mol": 1},
    "cd": {"cd": 1},
    "rad": {"rad": 1},
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


def base_unit_exponents(name: str) -> dict[str, int]:
    """The non-zero exponents of the SI base units; raises `ValueError` for a name that is not a unit."""
    above, slash, below = name.partition("/")
    if below.startswith("(") and below.endswith(")"):
        below = below[1:-1]
    elif "." in below:
        raise ValueError(f"unit {name}: expected parentheses around what is divided by")
    total: dict[str, int] = {}
    for sign, product in ((1, above), (-1, below)) if slash else ((1, above),):
        for factor in product.split("."):
            found = re.fullmatch(r"([A-Za-z]+|1)(-?\d+)?", factor)
            if found is None or found[1] not in SYMBOLS:
                raise ValueError(f"unit {name}: expected powers of {', '.join(SYMBOLS)} as in N.m, kg.m2 or W/(m2.K)")
            for base, exponent in SYMBOLS[found[1]].items():
                total[base] = total.get(base, 0) + sign * exponent * int(found[2] or 1)
    return {base: exponent for base, exponent in total.items() if exponent}
