"""Reads a TOML block of a page as the program does, and prints its kind: python -m docs.newcomer.readers FILE."""

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

from orchestration.foundation.basics.documents import read_toml

Tables = dict[str, Any]


def reader_of(tables: Tables) -> tuple[str, Callable[[Path], object]]:
    """The kind of a file with these tables, and its reader."""
    from orchestration.experiments.comparison.file import load_comparison
    from orchestration.experiments.studies.study_file import load_study
    from orchestration.experiments.tuning.tuning_file import load_tuning
    from orchestration.quadrotor.scenarios.vehicle import load_vehicle
    from orchestration.simulation.requests.request import load_request
    from orchestration.systems.expressions.syntax import parse

    def load_expressions(path: Path) -> object:
        return [parse(text) for text in tables.values()]

    if "axes" in tables:
        return "a study", load_study
    if "search" in tables:
        return "a tuning", load_tuning
    if "controllers" in tables and "front" in tables:
        return "a comparison", load_comparison
    if all(isinstance(value, str) for value in tables.values()):
        return "objectives", load_expressions
    if {"plant", "controller", "controllers"} >= tables.keys():
        return "a vehicle or a scenario", lambda path: load_vehicle(str(path), Path())
    return "a system or a scenario", load_request


if __name__ == "__main__":
    path = Path(sys.argv[1])
    kind, read = reader_of(read_toml(path, "TOML block"))
    read(path)
    print(kind)
