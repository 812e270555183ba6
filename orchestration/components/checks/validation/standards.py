"""The names in FMI 2.0 and FMI 3.0 of what both have."""

from collections.abc import Mapping
from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Lists:
    """The lists of the model structure: the name of each in findings, and the path of its entries."""

    outputs: tuple[str, str]
    derivatives: tuple[str, str]
    initial_unknowns: tuple[str, str]
    others: tuple[tuple[str, str], ...] = ()


@dataclass(frozen=True, kw_only=True)
class Standard:
    """A version of FMI."""

    version: int
    token: str
    """attribute by which a library identifies its description"""
    handle: str
    """attribute of the model structure that refers to a variable"""
    saves: str
    """capability to save and restore a state"""
    serialises: str
    """capability to serialise a state"""
    lists: Lists
    types: Mapping[str, str]
    """kind of variable, a type of FMI 2.0, by type"""
    access: Mapping[str, str]
    """suffix of the names of the functions that get and set a variable, by its type"""

    @property
    def instantiates(self) -> str:
        """The function that instantiates an FMU."""
        return "fmi2Instantiate" if self.version == 2 else "fmi3InstantiateCoSimulation"


_INTEGERS = tuple(f"{sign}{bits}" for bits in (8, 16, 32, 64) for sign in ("Int", "UInt"))
_OF_2 = ("Real", "Integer", "Boolean", "String", "Enumeration")
_OF_3 = {
    **dict.fromkeys(("Float64", "Float32"), "Real"),
    **dict.fromkeys(_INTEGERS, "Integer"),
    **{name: name for name in ("Boolean", "String", "Binary", "Enumeration", "Clock")},
}
STANDARDS: Mapping[int, Standard] = {
    2: Standard(
        version=2,
        token="guid",
        handle="index",
        saves="canGetAndSetFMUstate",
        serialises="canSerializeFMUstate",
        lists=Lists(
            outputs=("Outputs", "Outputs/Unknown"),
            derivatives=("Derivatives", "Derivatives/Unknown"),
            initial_unknowns=("InitialUnknowns", "InitialUnknowns/Unknown"),
        ),
        types={name: name for name in _OF_2},
        access={name: name for name in _OF_2} | {"Enumeration": "Integer"},
    ),
    3: Standard(
        version=3,
        token="instantiationToken",
        handle="valueReference",
        saves="canGetAndSetFMUState",
        serialises="canSerializeFMUState",
        lists=Lists(
            outputs=("Output", "Output"),
            derivatives=("ContinuousStateDerivative", "ContinuousStateDerivative"),
            initial_unknowns=("InitialUnknown", "InitialUnknown"),
            others=(("ClockedState", "ClockedState"), ("EventIndicator", "EventIndicator")),
        ),
        types=_OF_3,
        access={name: name for name in _OF_3} | {"Enumeration": "Int64"},
    ),
}
"""By version"""
