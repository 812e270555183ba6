"""A run's directory: complete or not there, whatever happens while it is written."""

import dataclasses
import json
import os
import shutil
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import cast

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

import quadcosim
from fmu_kit import new_files
from orchestration.foundation.recording.recording import Chunk, Events, InMemory, Recorder
from orchestration.quadrotor.flight.names import FIGURES as FLIGHT
from orchestration.simulation.figures.names import WRITTEN
from orchestration.simulation.figures.style import SCREEN, save
from orchestration.simulation.figures.views import VIEWS
from orchestration.simulation.results.units import ColumnInfo
from orchestration.simulation.runs import draw as drawing
from orchestration.simulation.runs.run_directory import keep_run
from quadcosim import (  # fmt: skip
    QuadcosimError,
    Result,
    RunInterrupted,
    Scenario,
    Timing,
    UsageError,
    load_run,
    save_run,
)
from tests.extent import in_test_all
from tests.native import native
from tests.pictures import expect_picture

FILES = {"signals.parquet", "events.parquet", "metrics.json", "scenario.toml"}
FIRST = VIEWS["flight"].first
FIGURES = {f"{name}.{ending}" for name in FIRST for ending in WRITTEN}
SMALL = dataclasses.replace(SCREEN, dpi=40.0, formats=("png",))


@pytest.fixture(scope="module")
def result() -> Result:
    timing = Timing(delay=0.003, measurement_loss=0.2, command_loss=0.2, noise={"position": 0.01})
    return quadcosim.run(native(stop_time=0.3, timing=timing).with_changes(parameters={"plant.mass": 1.1}))


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return tmp_path / "results" / "run"


@pytest.fixture(scope="module")
def drawn(result: Result, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The directory of the run with its figures, alone in its folder."""
    return save_run(result, tmp_path_factory.mktemp("results") / "run")


def looks_whole(folder: Path) -> bool:
    """Whether someone who looks for results would take `folder` for a run."""
    return not folder.name.startswith(".") and any((folder / name).exists() for name in FILES)


def contents(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir()}


# -- writing and reading ----------------------------------------------------------------------------------


def test_a_directory_has_all_files(drawn: Path) -> None:
    assert drawn.name == "run"
    assert {path.name for path in drawn.iterdir()} >= FILES | FIGURES
    assert list(drawn.parent.iterdir()) == [drawn]


def test_figures_can_be_left_out(result: Result, folder: Path) -> None:
    save_run(result, folder, figures=False)
    names = {path.name for path in folder.iterdir()}
    assert names >= FILES
    assert not names & FIGURES


def test_a_run_read_back_is_the_run_written(result: Result, folder: Path) -> None:
    described = {**result.described, "time": ColumnInfo(unit="s", text="as long as of many columns " * 50_000)}
    again = load_run(save_run(dataclasses.replace(result, described=described), folder, figures=False))
    assert again.described == described
    assert again.columns == result.columns
    assert again.rows.tobytes() == result.rows.tobytes()
    assert again.events == result.events
    assert again.metrics == result.metrics
    assert again.request == result.request
    assert again.provenance == result.provenance
    assert (again.divergence, again.warnings) == (result.divergence, result.warnings)


def test_a_diverged_run_is_read_back_with_its_reason(folder: Path) -> None:
    diverged = quadcosim.run(native(stop_time=2.0, timing=Timing(period=0.3)))
    again = load_run(save_run(diverged, folder, figures=False))
    assert again.divergence == diverged.divergence
    assert again.metrics["diverged"] is True
    assert {path.stem for path in save(drawing.draw(diverged, FIRST), folder, SMALL)} == {*FIRST}


def test_signals_are_named_columns_of_doubles(result: Result, folder: Path) -> None:
    table = pq.read_table(save_run(result, folder, figures=False) / "signals.parquet")
    assert table.column_names[0] == "time"
    assert {"plant.position.x", "plant.thrust", "controller.thrust", "controller.energy"} <= set(table.column_names)
    assert {str(column.type) for column in table.schema} == {"double"}
    assert table["plant.position.x"].to_numpy().tolist() == result.signals["plant.position.x"].tolist()


def test_events_tell_what_happened_when(result: Result, folder: Path) -> None:
    rows = pq.read_table(save_run(result, folder, figures=False) / "events.parquet").to_pylist()
    assert {row["event"] for row in rows} == {"sampled", "sent", "arrived", "lost"}
    assert {row["what"] for row in rows} == {"measurement", "command"}
    assert [row["time"] for row in rows] == [event.time / 1e9 for event in result.events]


def test_metrics_are_standard_json(result: Result, folder: Path) -> None:
    def refuse(constant: str) -> None:
        raise AssertionError(f"{constant} is no JSON")

    text = (save_run(result, folder, figures=False) / "metrics.json").read_text()
    assert json.loads(text, parse_constant=refuse) == result.metrics


def test_the_scenario_in_the_directory_flies_to_the_same_bits(result: Result, folder: Path) -> None:
    scenario = quadcosim.load_scenario(save_run(result, folder, figures=False) / "scenario.toml")
    assert quadcosim.run(scenario).rows.tobytes() == result.rows.tobytes()


def test_figures_are_pictures_with_something_on_them(drawn: Path) -> None:
    for name in FIRST:
        expect_picture(drawn / f"{name}.png")
        assert b"<svg" in (drawn / f"{name}.svg").read_bytes()


@pytest.mark.parametrize("window", [(0.1, 0.2), (5.0, 6.0)])
def test_the_commands_are_zoomed_on_the_window(result: Result, window: tuple[float, float]) -> None:
    whole, zoom, *_ = drawing.draw(result, ["commands"], window=window)["commands"].axes
    assert zoom.get_xlim() == window
    assert whole.get_xlim() == pytest.approx((0.0, 0.3))


@in_test_all
def test_a_run_without_samples_can_be_drawn(tmp_path: Path) -> None:
    without = quadcosim.run(native(stop_time=0.05, timing=Timing(offset=1.0)))
    drawn = {path.stem for path in save(drawing.draw(without), tmp_path, SMALL)}
    assert drawn == {*FLIGHT} - {"energy", "spectrum"}


def test_no_energy_is_drawn_of_a_controller_that_has_none() -> None:
    simulated = quadcosim.run(native(stop_time=0.1))
    place = simulated.columns.index("controller.energy")
    columns, without = (*simulated.columns[:place], *simulated.columns[place + 1 :]), InMemory()
    without.begin(columns)
    without.take(
        Chunk(columns=columns, rows=np.delete(simulated.rows, place, axis=1), events=Events.of(simulated.events))
    )
    assert set(drawing.draw(dataclasses.replace(simulated, recording=without))) == {*FLIGHT} - {"energy"}


# -- replacing --------------------------------------------------------------------------------------------


def test_an_earlier_run_is_replaced_whole(drawn: Path, folder: Path) -> None:
    shutil.copytree(drawn, folder)
    for name in ("plant.thrust", "plant.position"):
        (folder / f"{name}.png").touch()
    other = quadcosim.run(native(stop_time=0.1))
    save_run(other, folder, figures=False)
    assert not [*folder.glob("plant.*")]
    assert load_run(folder).rows.tobytes() == other.rows.tobytes()
    assert not FIGURES & {path.name for path in folder.iterdir()}
    assert list(folder.parent.iterdir()) == [folder]


def test_an_empty_directory_is_taken(result: Result, folder: Path) -> None:
    folder.mkdir(parents=True)
    save_run(result, folder, figures=False)
    assert load_run(folder).metrics == result.metrics


def test_a_directory_of_something_else_is_left_alone(result: Result, folder: Path) -> None:
    folder.mkdir(parents=True)
    (folder / "thesis.tex").write_text("years of work")
    with pytest.raises(UsageError, match="expected a new or empty directory, or that of an earlier run"):
        save_run(result, folder)
    assert contents(folder) == {"thesis.tex": b"years of work"}
    assert list(folder.parent.iterdir()) == [folder]


def test_a_file_is_left_alone(result: Result, folder: Path) -> None:
    folder.parent.mkdir()
    folder.write_text("years of work")
    with pytest.raises(UsageError, match="expected a new or empty directory"):
        save_run(result, folder)
    assert folder.read_text() == "years of work"


@pytest.mark.parametrize("name", sorted(FILES))
def test_a_directory_that_lacks_a_file_is_no_run(result: Result, folder: Path, name: str) -> None:
    (save_run(result, folder, figures=False) / name).unlink()
    with pytest.raises(UsageError, match=f"expected the directory of a run; it has no {name}"):
        load_run(folder)


def test_what_is_not_there_is_no_run(folder: Path) -> None:
    with pytest.raises(UsageError, match="expected the directory of a run"):
        load_run(folder)


# -- when writing does not end well -----------------------------------------------------------------------


@pytest.fixture(
    params=[
        "foundation.recording.tables.ToFolder.take",
        "foundation.recording.tables.copy",
        "simulation.runs.draw.draw",
    ]
)
def failing(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """One of the steps of writing fails as on a full disk."""

    def fail(*_: object) -> None:
        raise OSError("no space left on device")

    with monkeypatch.context() as patch:
        patch.setattr(f"orchestration.{request.param}", fail)
        yield


@pytest.mark.usefixtures("failing")
def test_a_failure_while_writing_leaves_nothing(result: Result, folder: Path) -> None:
    with pytest.raises(OSError, match="no space left"):
        save_run(result, folder)
    assert not folder.parent.exists()


def test_a_failure_while_writing_leaves_the_earlier_run(
    result: Result, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    before = contents(save_run(result, folder, figures=False))

    def interrupt(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(drawing, "draw", interrupt)
    with pytest.raises(KeyboardInterrupt):
        save_run(quadcosim.run(native(stop_time=0.05)), folder)
    assert contents(folder) == before
    assert list(folder.parent.iterdir()) == [folder]


WRITER = """
import sys, time, types
import quadcosim

def wait(*_):
    print("writing", flush=True)
    time.sleep(6000)

sys.modules["orchestration.simulation.runs.draw"] = types.SimpleNamespace(draw=wait)
native = {"plant": "native/QuadrotorPlant", "controller": "native/UnifiedController"}
quadcosim.save_run(quadcosim.run(quadcosim.Scenario(stop_time=0.05).with_fmus(**native)), sys.argv[1])
"""


@contextmanager
def writing(folder: Path) -> Iterator[subprocess.Popen[str]]:
    """Another process that has written all of a run but the figures."""
    with subprocess.Popen([sys.executable, "-c", WRITER, str(folder)], stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "writing\n"
        yield process


def kill_while_writing(folder: Path) -> None:
    """Start to write a run in another process, and kill that when all but the figures is on disk."""
    with writing(folder) as process:
        process.kill()
    assert process.returncode == (-signal.SIGKILL if sys.platform != "win32" else 1)
    new_files._cleared.clear()  # as in another process


@in_test_all
def test_a_killed_process_leaves_the_earlier_run_as_it_was(result: Result, folder: Path) -> None:
    before = contents(save_run(result, folder, figures=False))
    kill_while_writing(folder)
    assert contents(folder) == before
    assert [path for path in folder.parent.iterdir() if looks_whole(path)] == [folder]
    save_run(result, folder, figures=False)  # what is left over is not in the way
    assert load_run(folder).events == result.events


@pytest.mark.skipif(sys.platform == "win32", reason="folders have no locks there")
def test_what_a_killed_process_leaves_does_not_look_whole_and_is_gone_after_the_next_start(
    result: Result, folder: Path
) -> None:
    kill_while_writing(folder)
    assert not folder.exists()
    left = list(folder.parent.iterdir())
    assert left  # it was in the middle of writing
    assert not any(looks_whole(path) for path in left)
    other = folder.with_name("other")
    with writing(folder) as living:
        save_run(result, other, figures=False)
        hidden = [path for path in folder.parent.iterdir() if path != other]
        assert len(hidden) == 1  # the living one's
        living.kill()
    new_files._cleared.clear()
    save_run(result, other, figures=False)
    assert list(folder.parent.iterdir()) == [other]


@pytest.mark.skipif(sys.platform == "win32", reason="folders have no locks there")
@pytest.mark.parametrize("renames", [1, 2])
def test_a_process_killed_between_two_renames_leaves_one_that_the_next_finishes(
    renames: int, result: Result, folder: Path
) -> None:
    new = save_run(result, folder.with_name("new"), figures=False)
    old = save_run(quadcosim.run(native(stop_time=0.1)), folder.with_name("old"), figures=False)
    hidden = folder.parent / ".quadcosim-0123456789ab.new"
    for part in ("whole", "old"):
        (hidden / part).mkdir(parents=True)
    new.rename(hidden / "whole" / "run" if renames == 1 else folder)
    old.rename(hidden / "old" / "run")
    new_files._cleared.clear()
    save_run(result, folder.with_name("other"), figures=False)
    assert load_run(folder).rows.tobytes() == result.rows.tobytes()
    assert {path.name for path in folder.parent.iterdir()} == {"run", "other"}


@pytest.mark.skipif(sys.platform == "win32", reason="there is no umask")
@pytest.mark.parametrize("mask", [0o022, 0o027, 0o002])
def test_a_directory_follows_the_umask(mask: int, result: Result, folder: Path) -> None:
    before = os.umask(mask)
    try:
        save_run(result, folder, figures=False)
    finally:
        os.umask(before)
    assert folder.stat().st_mode & 0o777 == 0o777 & ~mask


# -- a flight that goes into its directory ----------------------------------------------------------------


def never(_: Recorder) -> Result:
    raise AssertionError("simulated")


def test_a_directory_that_cannot_be_is_refused_before_the_flight(folder: Path) -> None:
    folder.parent.mkdir()
    (folder.parent / "file").write_text("years of work")
    with pytest.raises(UsageError, match="expected a directory that can be written"):
        keep_run(folder.parent / "file" / "run", never)
    with pytest.raises(UsageError, match="expected a new or empty directory, or that of an earlier run"):
        keep_run(folder.parent, never)
    assert [path.name for path in folder.parent.iterdir()] == ["file"]


def test_a_flight_whose_place_is_taken_meanwhile_is_kept_beside(result: Result, folder: Path) -> None:
    def simulate(recorder: Recorder) -> Result:
        folder.mkdir()
        (folder / "thesis.tex").write_text("years of work")
        folder.with_name("run.1").mkdir()
        return quadcosim.run(result.request, recorder=recorder)

    with pytest.raises(QuadcosimError, match=r"expected a new .*; what was written is in .*run\.2$"):
        keep_run(folder, simulate, figures=False)
    assert contents(folder) == {"thesis.tex": b"years of work"}
    assert load_run(folder.with_name("run.2")).rows.tobytes() == result.rows.tobytes()
    assert {path.name for path in folder.parent.iterdir()} == {"run", "run.1", "run.2"}


def test_a_flight_that_cannot_be_written_whole_is_kept_beside(
    result: Result, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: object) -> None:
        raise OSError("no space left on device")

    monkeypatch.setattr(drawing, "draw", fail)
    with pytest.raises(QuadcosimError, match=r"no space left on device; what was written is in .*run\.1$"):
        keep_run(folder, lambda to: quadcosim.run(result.request, recorder=to))
    assert load_run(folder.with_name("run.1")).rows.tobytes() == result.rows.tobytes()


@pytest.mark.parametrize("there", [False, True], ids=["nothing there", "a run there"])
def test_what_was_recorded_before_an_interruption_is_kept_but_replaces_nothing(
    there: bool, result: Result, folder: Path
) -> None:
    if there:
        save_run(result, folder, figures=False)
    place = folder.with_name("run.1") if there else folder

    def progress(share: float) -> None:
        os.kill(os.getpid(), signal.SIGINT)

    with pytest.raises(RunInterrupted, match=r"^at t = [0-2]\.\d+ s of 3 s; what was recorded is in ") as stop:
        keep_run(folder, lambda to: quadcosim.run(native(stop_time=3.0), recorder=to, progress=progress), figures=False)
    assert str(stop.value).endswith(str(place))
    kept = load_run(place)
    assert kept.interrupted_at == kept.signals["time"][-1] == kept.metrics["horizon"]
    assert max(event.time for event in kept.events) <= kept.interrupted_at * 1e9
    whole = quadcosim.run(native(stop_time=3.0))
    assert kept.rows.tobytes() == whole.rows[: len(kept.rows)].tobytes()
    if there:
        assert load_run(folder).interrupted_at is None


# -- what is damaged ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("columns", "expected"),
    [
        ({"time": None}, "no column time"),
        ({"plant.position.x": None}, "no column plant.position.x"),
        ({"reference.position.z": None}, "no column reference.position.z"),
        ({"time": pa.array([float("nan")])}, "signals.parquet: expected finite times"),
        ({"plant.tilt": pa.array(["a"])}, "plant.tilt (double)"),
        ({"plant.tilt": pa.array([None], pa.float64())}, "signals.parquet: expected columns without gaps"),
    ],
)
def test_signals_of_another_shape_are_refused(
    result: Result, folder: Path, columns: dict[str, pa.Array | None], expected: str
) -> None:
    path = save_run(result, folder, figures=False) / "signals.parquet"
    table = pq.read_table(path).slice(0, 1)
    for name, values in columns.items():
        at = table.column_names.index(name)
        table = table.remove_column(at) if values is None else table.set_column(at, name, values)
    pq.write_table(table, path)
    with pytest.raises(UsageError) as refused:
        load_run(folder)
    assert expected in str(refused.value)


@pytest.mark.parametrize("name", ["signals.parquet", "events.parquet"])
def test_no_flipped_bit_of_a_page_is_read_as_a_value(result: Result, folder: Path, name: str) -> None:
    path = save_run(result, folder, figures=False) / name
    content = bytearray(path.read_bytes())
    last = pq.ParquetFile(path).metadata.row_group(0).column(0)
    content[last.data_page_offset + last.total_compressed_size // 2] ^= 1
    path.write_bytes(content)
    with pytest.raises(UsageError, match="expected a Parquet file, as it was written"):
        load_run(folder)


@pytest.mark.parametrize(
    ("name", "text", "expected"),
    [
        ("metrics.json", "[]", "expected an object"),
        ("metrics.json", "{}", "diverged: expected what was written"),
        ("provenance.json", '{"divergence": 3, "warnings": []}', "divergence: expected what was written, got 3"),
        ("provenance.json", "{" * 5000, "expected JSON, as it was written"),
        ("metrics.json", '{"diverged": NaN}', "NaN is no JSON"),
    ],
)
def test_notes_of_another_shape_are_refused(result: Result, folder: Path, name: str, text: str, expected: str) -> None:
    (save_run(result, folder, figures=False) / name).write_text(text)
    with pytest.raises(UsageError) as refused:
        load_run(folder)
    assert expected in str(refused.value)


@pytest.mark.parametrize(
    ("name", "old", "new"),
    [
        ("metrics.json", '"diverged": false', '"diverged": true'),
        ("scenario.toml", "stop_time = 0.3", "stop_time = 0.4"),
        ("provenance.json", '"divergence": null', '"divergence": "no"'),
    ],
)
def test_a_file_that_was_edited_is_named(result: Result, folder: Path, name: str, old: str, new: str) -> None:
    path = save_run(result, folder, figures=False) / name
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new))
    with pytest.raises(UsageError) as refused:
        load_run(folder)
    assert str(refused.value) == f"{path}: has been changed since the run; expected it as it was written"


@pytest.mark.parametrize("name", ["signals.parquet", "events.parquet"])
def test_the_recording_of_another_run_is_refused_by_name(result: Result, folder: Path, name: str) -> None:
    other = quadcosim.run(dataclasses.replace(cast(Scenario, result.request), seed=5))
    save_run(result, folder, figures=False)
    save_run(other, folder.with_name("other"), figures=False)
    (folder / name).write_bytes((folder.with_name("other") / name).read_bytes())
    with pytest.raises(UsageError) as refused:
        load_run(folder)
    assert str(refused.value).startswith(f"{folder / name}: has been changed since the run")
