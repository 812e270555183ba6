"""The store: rows to the bit, one writer, many readers, and no damage whatever happens."""

import ast
import contextlib
import dataclasses
import functools
import json
import math
import os
import random
import re
import shutil
import signal
import sqlite3
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from orchestration.components.building import fmus
from orchestration.experiments.studies import store as stores
from orchestration.experiments.studies.axes import Axis
from orchestration.experiments.studies.run_key import run_key, study_parts
from orchestration.experiments.studies.store import open_for_reading, open_for_writing
from orchestration.experiments.studies.store_columns import TEXTS, metrics_with
from orchestration.experiments.studies.study import Study
from orchestration.quadrotor.scenarios.fmu_choice import FmuChoice
from orchestration.quadrotor.scenarios.translation import ReferenceChoice
from orchestration.quadrotor.scenarios.wiring import DEFAULT_PLANT
from orchestration.simulation.workers import provenance
from orchestration.simulation.workers.provenance import Sources, imported, simulation_sources, sources_hash, versions
from orchestration.systems.system.distribution import Distribution
from orchestration.systems.system.files import Files, files_of
from orchestration.systems.system.paths import changed as with_changes
from quadcosim import QuadcosimError, Scenario, UsageError
from tests.orchestration.experiments.studies.common import METRICS, OBJECTIVES, Row, add, files_in, one_line, row
from tests.places import ROOT

NUMBERS = [name for name in METRICS if name not in TEXTS]
# SQLite has one zero and keeps a NaN as NULL.
FLOATS = st.floats(allow_nan=False).filter(lambda value: value != 0.0 or math.copysign(1.0, value) > 0.0)


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "results" / "study.sqlite"


def written(path: Path, *rows: Row) -> Path:
    with open_for_writing(path, OBJECTIVES) as store:
        store.describe({"name": "value"})
        add(store, rows)
    return path


def rows_of(path: Path) -> list[dict[str, Any]]:
    with open_for_reading(path) as store:
        return list(store.rows())


def kept(path: Path) -> list[str]:
    """The keys of all rows of the file, those of runs that the design no longer has among them."""
    with contextlib.closing(sqlite3.connect(path)) as connection:
        return [key for (key,) in connection.execute("SELECT key FROM runs ORDER BY key")]


def indices(path: Path) -> list[int]:
    return [found["design_index"] for found in rows_of(path)]


# -- rows -------------------------------------------------------------------------------------------------


@given(values=st.lists(st.none() | FLOATS, min_size=len(NUMBERS), max_size=len(NUMBERS)), duration=FLOATS)
def test_a_row_comes_back_to_the_bit(
    tmp_path_factory: pytest.TempPathFactory, values: list[float | None], duration: float
) -> None:
    path = tmp_path_factory.mktemp("store") / "study.sqlite"
    metrics = dict(zip(NUMBERS, values, strict=True))
    (found,) = rows_of(written(path, row(metrics=metrics, duration=duration)))
    assert repr([found[name] for name in NUMBERS]) == repr(values)
    assert found["duration"].hex() == duration.hex()


def test_all_other_fields_of_a_row_are_read_back(path: Path) -> None:
    settings = {"period": 0.1 + 0.2, "order": "jacobi", "flag": True, "whole": 3}
    (found,) = rows_of(written(path, row(7, key="abc", settings=settings, seed=2**62, message='it\'s "κ"\nso')))
    assert found["settings"] == settings
    assert [type(value) for value in found["settings"].values()] == [float, str, bool, int]
    assert (found["design_index"], found["key"], found["seed"]) == (7, "abc", 2**62)
    assert found["message"] == 'it\'s "κ"\nso'


def test_a_run_that_failed_has_no_metrics_and_is_counted_as_failed(path: Path) -> None:
    written(path, row(0), row(1, metrics=None, message="mass"), row(2, message="diverged, which is a result"))
    found = rows_of(path)
    assert [each["status"] for each in found] == ["done", "failed", "done"]
    assert all(found[1][name] is None for name in METRICS)
    with open_for_reading(path) as store:
        assert store.counts() == {"done": 2, "failed": 1}


def test_rows_come_sorted_by_design_index_whatever_the_order_they_were_written_in(path: Path) -> None:
    assert indices(written(path, row(5), row(1), row(3))) == [1, 3, 5]
    assert indices(written(path, row(2), row(0))) == [0, 1, 2, 3, 5]


def test_a_row_of_the_same_run_is_replaced_and_one_of_another_run_takes_its_place(path: Path) -> None:
    written(path, row(0, metrics=None, message="no"), row(1))
    written(path, row(0), row(1, key="new"))
    with open_for_reading(path) as store:
        assert [found["key"] for found in store.rows()] == ["key 0", "new"]
        assert store.counts() == {"done": 2}
    assert kept(path) == ["key 0", "key 1", "new"]


def test_a_changed_design_keeps_the_rows_of_its_runs_at_their_new_indices(path: Path) -> None:
    with open_for_writing(path, OBJECTIVES) as store:
        add(store, [row(0, seed=10), row(1, seed=11, metrics=None)])
        places = [(i, key, "{}") for i, key in enumerate(["new", "key 1", "key 0", "new"])]
        store.describe({"name": "value"}, places)
        assert [(found["design_index"], found["seed"]) for found in store.rows()] == [(1, 11), (2, 10)]
        assert store.missing().tolist() == [[0, 2]]
        assert store.missing(failed_too=True).tolist() == [[0, 2], [1, 0]]
        assert store.keys(np.array([0, 2])) == ["new", "key 0"]
        assert store.counts() == {"done": 1, "failed": 1}


def test_entries_about_a_study_are_replaced_by_name(path: Path) -> None:
    with open_for_writing(path, OBJECTIVES) as store:
        store.describe({"a": "1", "b": "2"})
        store.describe({"b": "3"})
        assert store.about() == {"objectives": json.dumps(OBJECTIVES), "a": "1", "b": "3"}


def test_rows_that_cannot_be_written_together_are_not_written_at_all(path: Path) -> None:
    written(path, row(0))
    bad = dataclasses.replace(row(2), key=None)  # type: ignore[arg-type]
    with open_for_writing(path, OBJECTIVES) as store:
        with pytest.raises(QuadcosimError, match="NOT NULL"):
            add(store, [row(1), bad])
        assert kept(path) == ["key 0"]


# -- writers and readers ----------------------------------------------------------------------------------


def test_a_second_writer_in_this_process_is_refused_in_one_line(path: Path) -> None:
    with open_for_writing(path, OBJECTIVES) as store:
        with pytest.raises(QuadcosimError, match="another sweep is writing into it") as caught:
            written(path, row(1))
        one_line(caught.value)
        add(store, [row(0)])
    assert indices(written(path, row(1))) == [0, 1]


WRITER = """
import sys
from pathlib import Path
from orchestration.experiments.studies.store import open_for_writing
from tests.orchestration.experiments.studies.common import OBJECTIVES, add, row
with open_for_writing(Path(sys.argv[1]), OBJECTIVES) as store:
    for index in range(100):
        add(store, [row(index)])
        print(index, flush=True)
        sys.stdin.readline()
"""


class Writer:
    """Another process that holds the store and writes a row whenever it is told to."""

    def __init__(self, path: Path) -> None:
        self.process = subprocess.Popen(
            [sys.executable, "-c", WRITER, str(path)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
            cwd=ROOT,
        )  # fmt: skip
        self.expect(0)

    def write(self, index: int) -> None:
        assert self.process.stdin is not None
        self.process.stdin.write("\n")
        self.process.stdin.flush()
        self.expect(index)

    def expect(self, index: int) -> None:
        assert self.process.stdout is not None
        assert self.process.stdout.readline() == f"{index}\n"

    def kill(self) -> None:
        self.process.kill()
        self.process.communicate()


@pytest.fixture
def writer(path: Path) -> Iterator[Writer]:
    other = Writer(path)
    yield other
    other.kill()


def test_a_store_is_read_while_another_process_writes(path: Path, writer: Writer) -> None:
    with open_for_reading(path) as store:
        for index in range(1, 4):
            writer.write(index)
            assert store.counts() == {"done": index + 1}
            assert [found["design_index"] for found in store.rows()] == list(range(index + 1))


def test_a_second_writer_is_refused_until_the_first_has_been_killed(path: Path, writer: Writer) -> None:
    writer.write(1)
    with pytest.raises(QuadcosimError, match="another sweep is writing into it"):
        written(path, row(9))
    writer.kill()
    assert indices(written(path, row(9))) == [0, 1, 9]


def test_a_reader_does_not_keep_the_writer_from_finishing(path: Path) -> None:
    written(path, row(0), row(1))
    with open_for_reading(path) as store:
        reading = store.rows()
        assert next(reading)["design_index"] == 0
        with open_for_writing(path, OBJECTIVES) as writing:
            add(writing, [row(2)])
            assert writing.counts() == {"done": 3}
            del reading  # lets the checkpoint at the end go through
    assert indices(path) == [0, 1, 2]


def test_readers_leave_nothing_beside_a_store_and_do_not_change_it(path: Path) -> None:
    written(path, row(0), row(1))
    before = {file.name: file.read_bytes() for file in path.parent.iterdir()}
    with open_for_reading(path) as one:
        with open_for_reading(path) as other:
            assert one.counts() == other.counts() == {"done": 2}
        assert len(list(one.rows())) == 2
        with pytest.raises(QuadcosimError, match="readonly"):
            add(one, [row(2)])
    assert {file.name: file.read_bytes() for file in path.parent.iterdir()} == before
    assert {*before} <= {path.name, f"{path.name}.lock"}


# -- read-only places -------------------------------------------------------------------------------------


@pytest.fixture
def read_only_place(monkeypatch: pytest.MonkeyPatch) -> list[Path]:
    """Opening fails the first time, as it does where WAL cannot write beside the file; what was opened."""
    genuine, opened = stores._read_only, []

    def refuse_once(path: Path) -> sqlite3.Connection:
        opened.append(path)
        if len(opened) == 1:
            raise sqlite3.OperationalError("unable to open database file")
        return genuine(path)

    monkeypatch.setattr(stores, "_read_only", refuse_once)
    return opened


def test_a_store_without_write_access_is_read_with_the_content_of_its_log(
    tmp_path: Path, path: Path, read_only_place: list[Path]
) -> None:
    frozen = tmp_path / "frozen" / "study.sqlite"
    frozen.parent.mkdir()
    with open_for_writing(path, OBJECTIVES) as store:
        add(store, [row(0), row(1)])
        for suffix in ("", "-wal"):  # as if its writer had been killed now
            shutil.copyfile(f"{path}{suffix}", f"{frozen}{suffix}")
    assert Path(f"{frozen}-wal").stat().st_size > 0
    before = {file.name: file.read_bytes() for file in frozen.parent.iterdir()}
    assert indices(frozen) == [0, 1]
    assert {file.name: file.read_bytes() for file in frozen.parent.iterdir()} == before
    assert len(read_only_place) == 2
    assert not read_only_place[1].exists(), "expected the copy to be gone"


def test_a_store_without_a_log_is_read_without_write_access(path: Path, read_only_place: list[Path]) -> None:
    written(path, row(0))
    Path(f"{path}-wal").unlink(missing_ok=True)
    assert indices(path) == [0]
    assert len(read_only_place) == 2


# -- what goes wrong --------------------------------------------------------------------------------------


@contextlib.contextmanager
def connections(pragma: str = "", timeout: float = 10.0) -> Iterator[None]:
    """Each connection made meanwhile waits so long for a lock [s], and is given a limit."""
    genuine = sqlite3.connect

    def connect(*arguments: Any, **options: Any) -> sqlite3.Connection:
        connection = genuine(*arguments, **{**options, "timeout": timeout})
        connection.execute(pragma)
        return connection

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sqlite3, "connect", connect)
        yield


def integrity(path: Path) -> str:
    with contextlib.closing(sqlite3.connect(path)) as connection:
        return str(connection.execute("PRAGMA integrity_check").fetchone()[0])


def test_a_full_disk_is_reported_in_one_line_and_the_store_is_unchanged(path: Path) -> None:
    written(path, *(row(index) for index in range(20)))
    pages = path.stat().st_size // 4096 + 2
    with connections(f"PRAGMA max_page_count = {pages}"), open_for_writing(path, OBJECTIVES) as store:
        with pytest.raises(QuadcosimError, match=r"study.sqlite: the store cannot be used: .*full") as caught:
            add(store, [row(20 + index, message="x" * 1000) for index in range(100)])
        one_line(caught.value)
        assert store.counts() == {"done": 20}
    assert integrity(path) == "ok"
    assert indices(written(path, row(20))) == list(range(21))


def test_a_full_disk_at_the_start_is_reported_in_one_line(path: Path) -> None:
    with connections("PRAGMA max_page_count = 1"), pytest.raises(QuadcosimError, match="full") as caught:
        written(path, row(0))
    one_line(caught.value)
    assert indices(written(path, row(0))) == [0]


@pytest.mark.parametrize("pages", range(1, 10))
def test_a_full_disk_while_a_store_is_created_leaves_a_usable_one(path: Path, pages: int) -> None:
    with (
        connections(f"PRAGMA max_page_count = {pages}"),
        contextlib.suppress(QuadcosimError),
        open_for_writing(path, OBJECTIVES),
    ):
        pass
    assert indices(written(path, row(0))) == [0]


KILLED = """
import os, signal, sqlite3, sys
from pathlib import Path
from orchestration.experiments.studies.store import open_for_writing

genuine = sqlite3.connect

def connect(*arguments, **options):
    connection = genuine(*arguments, **options)
    made = []

    def hear(statement):
        made.extend([statement] * statement.startswith("CREATE TABLE"))
        if len(made) == int(sys.argv[2]):
            os.kill(os.getpid(), signal.SIGKILL)

    connection.set_trace_callback(hear)
    return connection

sqlite3.connect = connect
with open_for_writing(Path(sys.argv[1]), sys.argv[3:]):
    pass
"""


@pytest.mark.parametrize("table", [1, 2, 3])
def test_a_store_whose_creation_is_killed_between_two_tables_is_created_by_the_next_sweep(
    path: Path, table: int
) -> None:
    ended = subprocess.run([sys.executable, "-c", KILLED, str(path), str(table), *OBJECTIVES], check=False)
    assert ended.returncode == -signal.SIGKILL
    with pytest.raises(QuadcosimError, match="nothing has been written into it yet"), open_for_reading(path):
        pass
    assert indices(written(path, row(0))) == [0]


def test_a_store_without_a_study_takes_the_objectives_of_the_next_one(path: Path) -> None:
    with open_for_writing(path, ["of_the_first"]):
        pass
    with open_for_writing(path, ["of_the_next"]) as store:
        assert store.metrics == metrics_with(["of_the_next"])
        add(store, [row(0)])
    with open_for_writing(path, ["of_the_last"]) as store:
        assert store.metrics == metrics_with(["of_the_next"])


def test_a_locked_store_is_reported_in_one_line_and_remains_intact(path: Path) -> None:
    written(path, row(0))
    with contextlib.closing(sqlite3.connect(path)) as other, connections(timeout=0.05):
        other.execute("BEGIN EXCLUSIVE")
        with open_for_writing(path, OBJECTIVES) as store:
            with pytest.raises(QuadcosimError, match=r"the store cannot be used: database is locked") as caught:
                add(store, [row(1)])
            one_line(caught.value)
            other.rollback()
            add(store, [row(2)])
    assert indices(path) == [0, 2]
    assert integrity(path) == "ok"


def test_a_locked_store_is_still_read(path: Path) -> None:
    written(path, row(0))
    with contextlib.closing(sqlite3.connect(path)) as other:
        other.execute("BEGIN EXCLUSIVE")
        assert indices(path) == [0]


@pytest.mark.parametrize("open_it", [open_for_reading, functools.partial(open_for_writing, objectives=OBJECTIVES)])
def test_a_file_that_is_no_store_is_reported_in_one_line_and_unchanged(tmp_path: Path, open_it: Any) -> None:
    path = tmp_path / "study.sqlite"
    path.write_bytes(b"this is no database, but it is long enough to be looked at. " * 20)
    before = path.read_bytes()
    with pytest.raises(QuadcosimError, match=r"study.sqlite: .*file is not a database") as caught, open_it(path):
        pass
    one_line(caught.value)
    assert path.read_bytes() == before


def test_another_database_is_reported_in_one_line(tmp_path: Path) -> None:
    path = tmp_path / "other.sqlite"
    with contextlib.closing(sqlite3.connect(path)) as connection, connection:
        connection.execute("CREATE TABLE music (name TEXT)")
    with (
        pytest.raises(QuadcosimError, match="no store of this version of quadcosim; expected one") as caught,
        open_for_reading(path),
    ):
        pass
    one_line(caught.value)


def test_a_missing_store_is_reported_in_one_line_and_not_created(path: Path) -> None:
    with pytest.raises(UsageError, match="there is no such file") as caught, open_for_reading(path):
        pass
    one_line(caught.value)
    assert not path.exists()


def test_a_folder_that_cannot_be_created_is_reported_in_one_line(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(QuadcosimError, match="the store cannot be used") as caught:
        written(tmp_path / "file" / "study.sqlite", row(0))
    one_line(caught.value)


# -- keys -------------------------------------------------------------------------------------------------

BASE = Scenario()
FILES = files_in(BASE)
OTHER_FMUS = [dataclasses.replace(FILES) for _ in FILES.fmus]
for changed, (name, content) in zip(OTHER_FMUS, FILES.contents.items(), strict=True):
    changed.__dict__["contents"] = {**FILES.contents, name: content + b" "}


def key_of(scenario: Scenario, files: Files | None = None) -> str:
    return run_key(scenario.as_system(), files or files_in(scenario))


def different_keys(tmp_path: Path) -> Iterator[str]:
    """Keys of runs that each differ from the paper's in one thing, the paper's first."""
    yield key_of(BASE)
    yield key_of(dataclasses.replace(BASE, stop_time=29.0))
    yield key_of(dataclasses.replace(BASE, seed=1))
    timing: list[dict[str, Any]] = [
        {"period": 0.02}, {"offset": 0.001}, {"plant_interval": 0.002}, {"order": "jacobi"}, {"hold": "first"},
        {"clock": "fmu"}, {"delay": math.nextafter(0.0, 1.0)}, {"delay_jitter": 0.001}, {"jitter": 0.001},
        {"jitter_distribution": "normal"}, {"measurement_loss": 0.1}, {"command_loss": 0.1}, {"burst_length": 2.0},
        {"clock_ratio": 1.001}, {"noise": {"position": 0.1}}, {"noise": {"velocity": 0.1}},
        {"quantisation": {"position": 0.1}},
    ]  # fmt: skip
    for changed in timing:
        yield key_of(BASE.with_changes(timing=changed))
    for name in ("plant.mass", "controller.mass", "plant.initial.position.x"):  # none starts at 1.25
        yield key_of(BASE.with_changes(parameters={name: 1.25}))
        yield key_of(BASE.with_changes(parameters={name: math.nextafter(1.25, 2.0)}))
    for files in OTHER_FMUS:  # to the byte, with the same GUID
        yield key_of(BASE, files)
    for content in ("time\n0\n", "time\n1\n"):
        file = tmp_path / "reference.csv"
        file.write_text(content)
        yield key_of(dataclasses.replace(BASE, reference=ReferenceChoice(file=file)))


def test_the_key_differs_with_everything_that_determines_a_run(tmp_path: Path) -> None:
    found = list(different_keys(tmp_path))
    assert len(found) == 30
    assert len(set(found)) == len(found)


def test_keys_that_came_later_are_not_in_what_studies_without_them_were_stored_by() -> None:
    parts = study_parts(Study(name="any", base=BASE, axes=(Axis(name="timing.period", values=(0.01,)),)))
    keys = {name.removeprefix("reference.") for name in parts if name.startswith("reference.")}
    assert keys == {"columns", "constant", "file", "interpolation", "name", "noise", "parameters", "period", "scale",
                    "to", "trajectory"}  # fmt: skip


def test_the_key_differs_with_a_distribution_and_the_content_of_a_trace_but_not_its_path(
    tmp_path: Path,
) -> None:
    def key(delay: Distribution) -> str:
        system = with_changes(BASE.as_system(), {"connections.command.delay": delay})
        return run_key(system, files_of(system))

    found = [key(Distribution(uniform=(0.0, most))) for most in (0.001, 0.002)]
    for name, content in (("one", "0.001"), ("two", "0.002"), ("three", "0.002")):
        (tmp_path / name).write_text(f"delay\n0.0\n{content}\n")
        found.append(key(Distribution(file=tmp_path / name, column="delay")))
    found.append(key(Distribution(file=tmp_path / "two", column="delay", order="as recorded")))
    assert found[3] == found[4]
    assert len(set(found)) == len(found) - 1


def test_the_key_differs_with_the_versions_of_the_software(monkeypatch: pytest.MonkeyPatch) -> None:
    before = key_of(BASE)
    monkeypatch.setattr("orchestration.experiments.studies.run_key.versions", lambda: {"numpy": "0.1"})
    assert key_of(BASE) != before


def test_the_key_does_not_depend_on_the_path_of_an_fmu_or_a_reference(tmp_path: Path) -> None:
    found = []
    for folder in (tmp_path / "one", tmp_path / "two"):
        folder.mkdir()
        plant = shutil.copy(fmus.locate(DEFAULT_PLANT), folder / "renamed.fmu")
        (folder / "reference.csv").write_text("time\n0\n")
        scenario = dataclasses.replace(
            BASE, plant=FmuChoice(fmu=str(plant)), reference=ReferenceChoice(file=folder / "reference.csv")
        )
        found.append(key_of(scenario))
    assert found[0] == found[1]


def test_the_key_does_not_depend_on_whether_a_model_mismatch_is_intended() -> None:
    assert key_of(BASE.with_changes(model_mismatch=True)) == key_of(BASE)


def test_the_key_does_not_depend_on_the_order_of_parameters() -> None:
    one = BASE.with_changes(parameters={"plant.mass": 1.0, "plant.gravity": 9.0})
    two = BASE.with_changes(parameters={"plant.gravity": 9.0, "plant.mass": 1.0})
    assert key_of(one) == key_of(two)


def test_a_parameter_set_to_its_start_value_is_the_same_run() -> None:
    assert key_of(BASE.with_changes(parameters={"plant.mass": 1.0, "controller.coupling": 1})) == key_of(BASE)
    heavy = BASE.with_changes(parameters={"plant.mass": 1.2})
    assert key_of(heavy.with_changes(parameters={"plant.mass": 1.0})) == key_of(BASE) != key_of(heavy)


@pytest.mark.parametrize(
    "module", ["orchestration.simulation.engines.master", "orchestration.systems.schedule.timetable",
               "orchestration.simulation.results.objectives", "fmu_kit.trajectory",
               "orchestration.components.fmi.native_instance", "orchestration.simulation.workers.task",
               "orchestration.quadrotor.scenarios.wiring"],
)  # fmt: skip
def test_an_edited_source_of_the_simulation_is_other_software(module: str, tmp_path: Path) -> None:
    sources = simulation_sources()
    edited = tmp_path / "edited.py"
    edited.write_bytes(sources[module].read_bytes() + b"\n")
    assert sources_hash({**sources, module: edited}) != sources_hash(sources) == versions()["sources"]


def test_sources_are_read_again_after_an_edit(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = tmp_path / "one.py"
    file.write_text("1")
    monkeypatch.setattr(provenance, "simulation_sources", lambda: {"one": file})
    read = Sources.read()
    assert read.current() is read
    file.write_text("2")
    os.utime(file, ns=(0, 0))
    assert read.current().hash == sources_hash({"one": file}) != read.hash


def test_every_header_that_c_of_the_simulation_includes_is_one_of_its_sources() -> None:
    sources = simulation_sources()
    written = {"operators.h", "sizes.h", "expressions.h"}  # by Python, for a system
    texts = [path.read_text(encoding="utf-8") for path in sources.values() if path.suffix in (".c", ".h")]
    included = {name for text in texts for name in re.findall(r'#include "(.+)"', text)}
    assert {"lanes.h", "mathematics.h"} < included <= written | {*sources}


def test_modules_started_by_name_are_among_the_sources_of_the_simulation() -> None:
    sources = simulation_sources()
    texts = [path.read_text(encoding="utf-8") for path in sources.values() if path.suffix == ".py"]
    started = {
        name for text in texts for name in re.findall(r'(?:command|Module\.of)\(\s*"(orchestration\.[\w.]+)"', text)
    }
    assert {"orchestration.components.fmi.isolated_process", "orchestration.simulation.runs.apart_process"} <= started
    assert started - {"orchestration.components.fmi.repeatability_process"} <= {*sources}  # makes no kept runs


def test_every_import_in_the_sources_of_the_simulation_is_found() -> None:
    for path in simulation_sources().values():
        if path.suffix == ".py":
            text = path.read_text(encoding="utf-8")
            nodes = [*ast.walk(ast.parse(text))]
            froms = [node for node in nodes if isinstance(node, ast.ImportFrom) and node.module]
            names = {f"{node.module}.{alias.name}" for node in froms for alias in node.names}
            names |= {alias.name for node in nodes if isinstance(node, ast.Import) for alias in node.names}
            assert {*imported(text)} >= names | {str(node.module) for node in froms}, path


def test_sources_that_only_show_or_keep_results_are_not_sources_of_the_simulation() -> None:
    aside = (
        "orchestration.simulation.figures.style",
        "orchestration.command.cli",
        "orchestration.experiments.studies.sweep",
        "orchestration.experiments.studies.store",
    )
    assert not {*aside} & {*simulation_sources()}


# -- damage -----------------------------------------------------------------------------------------------


DAMAGE = [
    "UPDATE runs SET position_rmse = 0.5000000000000001 WHERE key = 'key 1'",
    "UPDATE runs SET status = 'failed' WHERE key = 'key 1'",
    "UPDATE runs SET outcome = 'bounded' WHERE key = 'key 1'",
    "UPDATE runs SET key = 'key 9' WHERE key = 'key 1'",
    "UPDATE runs SET machine = 'elsewhere' WHERE key = 'key 1'",
    "UPDATE design SET settings = '{}' WHERE design_index = 1",
    "UPDATE design SET design_index = 7 WHERE design_index = 1",
    "UPDATE about SET value = 'other'",
    "ALTER TABLE runs RENAME COLUMN position_iae TO position_itea",
    "DROP TABLE design",
]


def counts_of(path: Path) -> dict[str, int]:
    with open_for_reading(path) as store:
        return store.counts()


def open_to_write(path: Path) -> None:
    with open_for_writing(path, OBJECTIVES):
        pass


@pytest.mark.parametrize("statement", DAMAGE)
@pytest.mark.parametrize("use", [rows_of, counts_of, open_to_write])
def test_a_value_that_was_not_written_by_the_store_is_detected(
    path: Path, statement: str, use: Callable[[Path], Any]
) -> None:
    written(path, row(0), row(1), row(2))
    with contextlib.closing(sqlite3.connect(path)) as other, other:
        other.execute(statement)
    with pytest.raises(QuadcosimError, match=r"the store is damaged|no store of this version") as caught:
        use(path)
    one_line(caught.value)


def test_no_damaged_byte_is_read_as_something_else(path: Path, tmp_path: Path) -> None:
    whole = rows_of(written(path, *(row(i, metrics={"outcome": "settled", "position_rmse": i / 7}) for i in range(40))))
    content, draw = path.read_bytes(), random.Random(0)
    noticed = 0
    for number in range(150):
        damaged = bytearray(content)
        for _ in range(draw.choice((1, 20))):
            damaged[draw.randrange(len(damaged))] ^= draw.randrange(1, 256)
        copy = tmp_path / f"{number}.sqlite"
        copy.write_bytes(damaged)
        try:
            assert rows_of(copy) == whole, "expected the error, or what was written"
        except QuadcosimError as error:
            one_line(error)
            noticed += 1
    assert noticed > 50
