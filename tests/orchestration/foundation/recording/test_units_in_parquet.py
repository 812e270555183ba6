"""The files of a run say themselves what unit their columns have."""

import dataclasses
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq
import pytest

import quadcosim
from orchestration.simulation.runs.run_directory import keep_run
from quadcosim import Result, save_run
from tests.native import NATIVE

SHORT = dataclasses.replace(NATIVE, stop_time=0.05)


@pytest.fixture(scope="module")
def result() -> Result:
    return quadcosim.run(SHORT)


def metadata_of(path: Path) -> dict[str, dict[bytes, bytes]]:
    """The metadata of each column that has any."""
    schema: Any = pq.read_schema(path)
    return {field.name: field.metadata for field in schema if field.metadata}


def test_a_run_that_is_saved_and_one_written_as_it_flies_say_the_units_of_their_columns(
    result: Result, tmp_path: Path
) -> None:
    saved = save_run(result, tmp_path / "saved", figures=False)
    keep_run(tmp_path / "recorded", lambda to: quadcosim.run(SHORT, recorder=to), figures=False)
    for folder in (saved, tmp_path / "recorded"):
        columns = metadata_of(folder / "signals.parquet")
        assert columns["time"][b"unit"] == b"s"
        assert columns["plant.torque.x"][b"unit"] == b"N.m"
        assert columns["reference.position.x"][b"unit"] == b"m"
        assert b"as of the last sample" in columns["controller.position_error.x"][b"description"]
        assert {name for name, one in result.described.items() if one.unit} == {
            name for name, one in columns.items() if b"unit" in one
        }
        assert metadata_of(folder / "events.parquet") == {"time": {b"unit": b"s"}}
