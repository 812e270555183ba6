"""The rows of one FMU as the table and the CSV file of fmpy: arrays whole, columns by type, then as declared."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from fmpy.util import write_csv

from fmu_kit.new_files import new_file
from orchestration.components.fmi.instance import INTEGERS
from orchestration.components.fmi.read_description import Model
from orchestration.simulation.runs.result import Result

_TYPES: dict[str, Any] = {
    "Real": np.float64, "Float32": np.float32, "Float64": np.float64, **INTEGERS, "Boolean": np.bool_,
}  # fmt: skip
"""Types in the order of the columns"""


def write(result: Result, model: Model, names: Sequence[str], path: Path) -> None:
    """Write `time` and the variables `names` of a run of one FMU, as `fmpy simulate --output-file` does."""
    with new_file(path) as new:
        write_csv(new, table(result, model, names))


def table(result: Result, model: Model, names: Sequence[str]) -> npt.NDArray[Any]:
    """The structured array of fmpy's `simulate_fmu`; `names` are scalars, and all elements of arrays."""
    ((component, stated),) = result.system.components.items()
    declared = {v.name: v for v in model.description.modelVariables}
    chosen = dict.fromkeys(model.variables[name].whole for name in names)
    integer = "Int64" if model.version == 3 else "Integer"
    types = {name: integer if declared[name].type == "Enumeration" else declared[name].type for name in chosen}
    ordered = sorted(chosen, key=lambda name: (list(_TYPES).index(types[name]), list(declared).index(name)))
    layout = [("time", np.float64, ())]
    layout += [(name, _TYPES[types[name]], tuple(declared[name].shape or ())) for name in ordered]
    filled = np.zeros(len(result.rows), dtype=layout)
    filled["time"] = np.round(result.signals["time"] + (stated.start_time or 0.0), 9)  # [s], to nanoseconds
    for name in ordered:
        elements = [v.name for v in model.variables.values() if v.whole == name]
        values = np.column_stack([result.signals[f"{component}.{element}"] for element in elements])
        filled[name] = values.astype(filled[name].dtype).reshape(filled[name].shape)
    return filled
