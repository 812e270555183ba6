"""The independent implementation gives the tables of `tests/data`, and it is independent."""

import ast
from pathlib import Path

import numpy as np
import pytest

from tests.reference.flight import Q0, fly, quaternion
from tests.reference.law import rotation
from tests.reference.tables import DATA, FLIGHTS, LAWS, difference, read, table, write

HERE = Path(__file__).parent
PROJECT = {"controller_fmu", "fmu_kit", "orchestration", "plant_fmu"}


def imported(path: Path) -> set[str]:
    """Modules that a file imports, as far as their names tell."""
    names = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            names.add(node.module or "")
    return names


def test_nothing_of_the_project_is_imported() -> None:
    modules = set().union(*map(imported, HERE.glob("*.py")))
    assert {"numpy", "scipy.integrate"} <= modules
    assert not {module for module in modules if module.partition(".")[0] in PROJECT}
    assert {module for module in modules if module.startswith("tests")} == {
        f"tests.reference.{name}" for name in ("flight", "law", "series", "tables")
    }


def test_every_table_has_its_generator() -> None:
    assert {path.name for path in DATA.glob("*.csv")} == {*LAWS, *FLIGHTS}


@pytest.mark.parametrize("name", LAWS)
def test_law_is_that_of_the_table(name: str) -> None:
    given = read(DATA / name)
    header, rows = table(name)
    assert header == given[0]
    assert difference(rows, given[1]) <= 1e-12


@pytest.mark.parametrize(("name", "stop"), [("closed_loop_10ms.csv", 2.0), ("closed_loop_20ms_delay_5ms.csv", 2.0),
                                            ("closed_loop_50ms.csv", 30.0)])  # fmt: skip
def test_flight_is_that_of_the_table(name: str, stop: float) -> None:
    """`python -m tests.reference` flies all of them to their end."""
    given = read(DATA / name)[1]
    rows = table(name, stop)[1]
    assert rows[:, 0].tolist() == list(range(int(stop) + 1))
    assert difference(rows, given[: len(rows)]) <= 1e-11


def test_flight_does_not_depend_on_the_tolerance_of_its_integration() -> None:
    """What is left of the integration's error is below what the tables are compared to."""
    period, delay = FLIGHTS["closed_loop_50ms.csv"]
    assert difference(fly(period, delay, stop=3.0, rtol=1e-10), fly(period, delay, stop=3.0)) <= 1e-9


@pytest.mark.parametrize("Q", [Q0, -Q0, np.array([1.0, 0.0, 0.0, 0.0]), np.array([0.5, -0.5, 0.5, 1e-9])])
def test_quaternion_of_a_matrix_is_the_one_that_made_it(Q: np.ndarray) -> None:
    Q = Q / np.linalg.norm(Q)
    np.testing.assert_allclose(quaternion(rotation(Q), Q), Q, rtol=0.0, atol=1e-14)


def test_table_that_is_written_is_read_to_the_bit(tmp_path: Path) -> None:
    header, rows = read(DATA / "law_general.csv")
    write(tmp_path / "copy.csv", header, rows)
    assert (tmp_path / "copy.csv").read_bytes() == (DATA / "law_general.csv").read_bytes()
