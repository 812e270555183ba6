"""What FMI 2.0 and FMI 3.0 call what both have."""

from collections.abc import Mapping
from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Lists:
    """Of a description, the lists of the model structure: what findings call each, and where its entries are."""

    outputs: tuple[str, str]
    derivatives: tuple[str, str]
    initial_unknowns: tuple[str, str]
    others: tuple[tuple[str, str], ...] = ()


@dataclass(frozen=True, kw_only=True)
class Standard:
    """A version of FMI."""

    version: int
    token: str
    """The attribute by which a library knows its description"""
    handle: str
    """The attribute of the model structure that says which variable is meant"""
    saves: str
    """The capability to save a state, and set it"""
    serialises: str
    """The capability to make bytes of a state"""
    lists: Lists
    types: Mapping[str, str]
    """Kind of variable, as FMI 2.0 calls its types, by the type"""
    access: Mapping[str, str]
    """The end of the name of the functions that get and set a variable, by its type"""

    @property
    def instantiates(self) -> str:
        """The function that makes an instance."""
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
