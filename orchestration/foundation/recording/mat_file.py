"""MAT-files: structures whose fields are valid MATLAB names."""

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from fmu_kit.new_files import new_file

MAX_NAME_LENGTH = 63
"""characters of a name in MATLAB"""
_KEYWORDS = {
    "break", "case", "catch", "classdef", "continue", "else", "elseif", "end", "for", "function", "global", "if",
    "otherwise", "parfor", "persistent", "return", "spmd", "switch", "try", "while",
}  # fmt: skip
"""Keywords of MATLAB"""

Struct = dict[str, Any]


def write(path: Path, variables: Mapping[str, Any]) -> Path:
    """Write variables by name, which may be structures, as a MAT-file of version 5; returns its path.

    None becomes NaN, a list of texts a cell array.
    """
    from scipy.io import savemat

    values = {name: _as_matlab(value) for name, value in variables.items()}
    with new_file(path) as new:
        savemat(new, values, do_compression=True, long_field_names=True, oned_as="column")
    return path


def nested(values: Mapping[str, Any]) -> Struct:
    """Dotted names as nested structures: `plant.position.x` is the field x of position of plant.

    A name that continues one with a value, as `mode.text` beside `mode`, is one field: `mode_text`.
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
    """Names as fields of one structure, `position_rmse`; dots become underscores."""
    fields: Struct = {}
    for name, value in values.items():
        fields[_free(valid(name), fields)] = value
    return fields


def valid(name: str) -> str:
    """A valid MATLAB name, as by its makeValidName: letters, digits and _, a letter first."""
    word = re.sub(r"\W", "_", name, flags=re.ASCII)
    if not re.match(r"[A-Za-z]", word) or word in _KEYWORDS:
        word = f"x{word}"
    return word[:MAX_NAME_LENGTH]


def _free(name: str, taken: Mapping[str, Any]) -> str:
    """The name, or the first one with a number that is not taken."""
    free, number = name, 1
    while free in taken:
        number += 1
        free = f"{name[: MAX_NAME_LENGTH - 4]}_{number}"
    return free


def _as_matlab(value: Any) -> Any:
    """The value in the form in which SciPy writes it as the matching MATLAB type."""
    if isinstance(value, Mapping):
        return {name: _as_matlab(one) for name, one in value.items()}
    if value is None:
        return np.nan
    if isinstance(value, (list, tuple)):
        return np.array([*value], dtype=object)
    return value
