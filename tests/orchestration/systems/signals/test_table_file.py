"""A reference from a CSV file: errors, and values between its rows."""

from pathlib import Path

import numpy as np
import pytest

from fmu_kit.trajectory import Trajectory
from orchestration.quadrotor.scenarios.wiring import REFERENCE
from orchestration.simulation.engines.sources import BuiltIn, TableValues
from orchestration.systems.signals.table_file import read_table
from quadcosim import UsageError

HEADER = ",".join(("time", *REFERENCE))
STOP = 2.0


def row(t: float | str, value: float | str = 0.0) -> str:
    return ",".join(map(str, (t, *[value] * len(REFERENCE))))


def table(tmp_path: Path, *rows: str, header: str = HEADER) -> TableValues:
    file = tmp_path / "reference.csv"
    file.write_text("\n".join((header, *rows)) + "\n", encoding="utf-8")
    return TableValues(*read_table(file, REFERENCE, STOP))


def refused(tmp_path: Path, *rows: str, header: str = HEADER) -> str:
    with pytest.raises(UsageError) as error:
        table(tmp_path, *rows, header=header)
    message = str(error.value)
    assert message.startswith(f"{tmp_path / 'reference.csv'}: ")
    assert "\n" not in message
    return message


def test_between_its_rows_a_table_is_linear(tmp_path: Path) -> None:
    reference = table(tmp_path, row(0.0, 1.0), row(0.5, 2.0), row(2.0, -1.0))
    for t, value in ((0.0, 1.0), (0.25, 1.5), (0.5, 2.0), (1.0, 1.0), (2.0, -1.0)):
        assert reference.at(t) == pytest.approx([value] * len(REFERENCE))
    assert reference.over(np.array([0.25, 1.0]))[:, 1] == pytest.approx([1.5, 1.0])


def test_at_its_rows_a_table_is_exact(tmp_path: Path) -> None:
    times, values = [0.0, 0.1, 0.3, 2.0], [0.1, 0.7, -1.3, 1e-17]
    reference = table(tmp_path, *(row(t, value) for t, value in zip(times, values, strict=True)))
    assert [reference.at(t)[0] for t in times[:-1]] == values[:-1]


def test_columns_are_found_by_name_in_any_order_among_others(tmp_path: Path) -> None:
    names = ["note", *reversed(REFERENCE), "time"]
    rows = [",".join(map(str, (7.0, *range(len(REFERENCE)), t))) for t in (0.0, STOP)]
    reference = table(tmp_path, *rows, header=" , ".join(names))
    assert reference.at(1.0) == list(reversed(range(len(REFERENCE))))


def test_a_table_may_reach_beyond_the_run_and_have_empty_lines(tmp_path: Path) -> None:
    reference = table(tmp_path, row(-1.0, 0.0), "", row(3.0, 4.0), "")
    assert reference.at(0.0)[:3] == pytest.approx([1.0] * 3)


@pytest.mark.parametrize("column", ["time", "reference.position.x", "reference.snap.z"])
def test_a_missing_column_is_named(tmp_path: Path, column: str) -> None:
    header = ",".join(name for name in HEADER.split(",") if name != column)
    message = refused(tmp_path, header=header)
    assert f"no column {column};" in message
    assert "expected time, reference.position.x" in message


def test_an_empty_file_misses_every_column(tmp_path: Path) -> None:
    assert "no column time, reference.position.x" in refused(tmp_path, header="")


@pytest.mark.parametrize("times", [(0.0, 1.5, 1.0, 2.0), (2.0, 0.0), (0.0, 2.0, 2.0)])
def test_times_that_do_not_increase_are_rejected(tmp_path: Path, times: tuple[float, ...]) -> None:
    assert "expected times that increase" in refused(tmp_path, *map(row, times))


def test_of_rows_of_one_time_the_last_counts_from_then_on(tmp_path: Path) -> None:
    jumping = table(tmp_path, row(0.0, 0.0), row(1.0, 4.0), row(1.0, 6.0), row(1.0, 8.0), row(2.0, 9.0))
    times = np.array([0.5, 0.75, 1.0, 1.5, 2.0])
    expected = [2.0, 3.0, 8.0, 8.5, 9.0]
    assert [jumping.at(t)[0] for t in times.tolist()] == expected
    assert jumping.at_each(times)[:, 0].tolist() == jumping.over(times)[:, 0].tolist() == expected


@pytest.mark.parametrize("times", [(0.1, 2.0), (0.0, 1.999), (5.0, 6.0)])
def test_a_table_that_does_not_cover_the_run_is_rejected(tmp_path: Path, times: tuple[float, ...]) -> None:
    assert "expected 0 to stop_time = 2 s" in refused(tmp_path, *map(row, times))


@pytest.mark.parametrize("cell", ["fast", "", "0x10"])
def test_values_that_are_no_numbers_are_rejected(tmp_path: Path, cell: str) -> None:
    assert f"line 3: reference.position.x = {cell}: expected numbers only" in refused(
        tmp_path, row(0.0), row(1.0, cell), row(2.0)
    )


@pytest.mark.parametrize("cell", ["nan", "inf", "-inf"])
def test_values_that_are_not_finite_are_rejected(tmp_path: Path, cell: str) -> None:
    assert f"line 3: reference.position.x = {cell}: expected finite numbers only" in refused(
        tmp_path, row(0.0), row(1.0, cell), row(2.0)
    )


@pytest.mark.parametrize("rows", [(), (0.0,)])
def test_fewer_than_two_rows_are_rejected(tmp_path: Path, rows: tuple[float, ...]) -> None:
    assert "expected at least two rows" in refused(tmp_path, *map(row, rows))


def test_rows_of_another_length_are_rejected(tmp_path: Path) -> None:
    assert "line 3: 17 values, expected 16" in refused(tmp_path, row(0.0), row(1.0) + ",3.0", row(2.0))
    assert "line 2: 15 values, expected 16" in refused(tmp_path, row(0.0).removesuffix(",0.0"), row(2.0))


@pytest.mark.parametrize(("separator", "name"), [(";", "semicolons"), ("\t", "tabulators")])
def test_columns_without_commas_are_rejected_naming_their_separator(tmp_path: Path, separator: str, name: str) -> None:
    rows = [row(t).replace(",", separator).replace(".", ",") for t in (0.0, 2.0)]
    message = refused(tmp_path, *rows, header=HEADER.replace(",", separator))
    assert message.endswith(f"columns separated by {name}; expected commas, and points in numbers")


@pytest.mark.parametrize("cell", ['"' + "1" * 200_000 + '"', "1\n" * 70_000 + '"', "0" * 200_000])
def test_a_field_or_a_line_without_end_is_rejected(tmp_path: Path, cell: str) -> None:
    assert "expected" in refused(tmp_path, row(0.0), row(1.0, cell), row(2.0))


def test_a_byte_order_mark_is_no_part_of_the_first_name(tmp_path: Path) -> None:
    reference = table(tmp_path, row(0.0, 1.0), row(2.0, 1.0), header=f"\ufeff{HEADER}")
    assert reference.at(1.0)[:3] == [1.0, 1.0, 1.0]


def test_a_file_that_cannot_be_read_is_rejected(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="expected a readable CSV file"):
        read_table(tmp_path / "none.csv", REFERENCE, STOP)
    (tmp_path / "binary.csv").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(UsageError, match="expected a readable CSV file"):
        read_table(tmp_path / "binary.csv", REFERENCE, STOP)


def test_the_built_in_reference_is_the_same_point_by_point_and_at_once() -> None:
    reference, times = BuiltIn(Trajectory(amplitude_y=1.5)), np.linspace(0.0, 30.0, 301)
    one_by_one = np.array([reference.at(t) for t in times.tolist()])
    assert reference.over(times) == pytest.approx(one_by_one, abs=1e-14)
    assert one_by_one[0].tolist() == [0.0, 0.0, 2.0]
