"""Numbers with names and units as a MAT-file: structures whose fields are names that MATLAB takes."""

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

LONGEST = 63
"""characters of a name in MATLAB"""
_KEYWORDS = {
    "break", "case", "catch", "classdef", "continue", "else", "elseif", "end", "for", "function", "global", "if",
    "otherwise", "parfor", "persistent", "return", "spmd", "switch", "try", "while",
}  # fmt: skip
"""of MATLAB"""

Struct = dict[str, Any]


def write(path: Path, variables: Mapping[str, Any]) -> Path:
    """Write variables by name, structures among them, as a MAT-file of version 5; its path.

    What MATLAB has no word for is made up: None is NaN, a list of texts a cell array.
    """
    from scipy.io import savemat

    path.parent.mkdir(parents=True, exist_ok=True)
    savemat(path, {name: _kept(value) for name, value in variables.items()}, do_compression=True, long_field_names=True,
            oned_as="column")  # fmt: skip
    return path


def nested(values: Mapping[str, Any]) -> Struct:
    """Dotted names as structures in each other: `plant.position.x` is the field x of position of plant.

    Where a name goes on after one that has a value itself, as `mode.text` beside `mode`, it is one field: `mode_text`.
    """
    tree: Struct = {}
    for name, value in values.items():
        parts, place = name.split("."), tree
        while len(parts) > 1 and isinstance(inner := place.get(valid(parts[0]), {}), dict):
            if name[: len(name) - len(".".join(parts[1:])) - 1] in values:
                break
            place = place.setdefault(valid(parts.pop(0)), inner)
        place[_free(valid("_".join(parts)), place)] = value
    return tree


def flat(values: Mapping[str, Any]) -> Struct:
    """Names as fields of one structure, `position_rmse`; dots are underlines."""
    fields: Struct = {}
    for name, value in values.items():
        fields[_free(valid(name), fields)] = value
    return fields


def valid(name: str) -> str:
    """A name that MATLAB takes, as its makeValidName would make it: letters, digits and _, a letter first."""
    word = re.sub(r"\W", "_", name, flags=re.ASCII)
    if not re.match(r"[A-Za-z]", word) or word in _KEYWORDS:
        word = f"x{word}"
    return word[:LONGEST]


def _free(name: str, taken: Mapping[str, Any]) -> str:
    """The name, or the first of it with a number that is not taken."""
    found, number = name, 1
    while found in taken:
        number += 1
        found = f"{name[: LONGEST - 4]}_{number}"
    return found


def _kept(value: Any) -> Any:
    """As SciPy takes it for what MATLAB has."""
    if isinstance(value, Mapping):
        return {name: _kept(one) for name, one in value.items()}
    if value is None:
        return np.nan
    if isinstance(value, (list, tuple)):
        return np.array([*value], dtype=object)
    return value
