"""Sweeps of the real FMUs: the same bits with any workers, whatever is killed, and no run repeated."""

import dataclasses
import json
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest

from orchestration.components.building.fmus import locate
from orchestration.experiments.studies.axes import Axis
from orchestration.experiments.studies.store import open_for_reading, store_path
from orchestration.experiments.studies.study import Study
from orchestration.experiments.studies.study_file import load_study
from orchestration.quadrotor.scenarios.fmu_choice import Record
from orchestration.simulation.workers import executors as engine
from orchestration.simulation.workers.provenance import machine, versions
from orchestration.simulation.workers.task import Runner, RunTask
from orchestration.systems.system.files import Files, files_of, with_files
from quadcosim import QuadcosimError, UsageError, run
from tests.native import NATIVE
from tests.orchestration.experiments.studies.common import (
    FAILS,
    PERIODS,
    RUNS,
    STORE,
    axis,
    bits,
    files_in,
    one_line,
    quadcosim,
    short,
    starts,
    study,
    sweep,
    swept,
)

# -- the same bits ----------------------------------------------------------------------------------------


def test_the_runs_of_the_reference_differ_from_each_other(reference: list[dict[str, Any]]) -> None:
    assert len({found["position_rmse"] for found in reference}) == RUNS
    assert len({found["seed"] for found in reference}) == RUNS
    assert {found["status"] for found in reference} == {"done"}


def test_two_workers_make_the_same_rows_as_one_and_leave_no_files_behind(
    folder: Path, reference: list[dict[str, Any]]
) -> None:
    temporary = folder / "temporary"
    temporary.mkdir()
    command = ("sweep", "study.toml", "--engine", "compiled", "--workers", "2")
    done = quadcosim(*command, cwd=folder, temporary=temporary)
    assert done.stdout.splitlines()[1:] == [f"{STORE}: {RUNS} runs, {RUNS} of them new"]
    assert " run Python; --engine auto is fast, by native twins" in done.stderr
    assert bits(folder / STORE) == reference
    assert list(temporary.iterdir()) == []


def test_the_order_of_runs_does_not_change_them(folder: Path, reference: list[dict[str, Any]]) -> None:
    chosen, runner = load_study(folder / "study.toml"), Runner()
    files = chosen.files()
    for index in (15, 3, 8, 0):
        system = with_files(chosen.system(index, starts()), files.fmus)
        metrics = runner.run(RunTask(index=0, key="", system=system)).metrics(0)
        assert metrics is not None
        assert metrics["position_rmse"].hex() == reference[index]["position_rmse"]
        assert metrics["control_effort.torque"].hex() == reference[index]["control_effort.torque"]


def test_a_row_has_the_metrics_of_a_direct_run(folder: Path, reference: list[dict[str, Any]]) -> None:
    direct = run(load_study(folder / "study.toml").system(9, starts())).metrics
    for name, value in direct.items():
        expected = value if value is None or isinstance(value, str) else float(value).hex()
        assert reference[9][name] == expected, name


# -- what a store holds -----------------------------------------------------------------------------------


def test_a_finished_study_is_not_run_again_and_progress_starts_at_the_existing_rows(tmp_path: Path) -> None:
    heard: list[tuple[int, int]] = []
    first, second = (
        sweep(study(PERIODS), out=tmp_path, progress=lambda done, total: heard.append((done, total))) for _ in range(2)
    )
    assert (first.total, first.flown, first.failed) == (2, 2, 0)
    assert (second.total, second.flown, second.failed) == (2, 0, 0)
    assert heard == [(0, 2), (1, 2), (2, 2), (2, 2)]


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a finished study."""
    folder = tmp_path_factory.mktemp("finished")
    swept(study(PERIODS), folder)
    return folder


HEAVY = short().with_changes(parameters={"plant.mass": 1.1})
CHANGES: list[tuple[Study, str]] = [
    (study(PERIODS, base=short(delay=0.001)), r"timing.delay was 0.0, is 0.001"),
    (study(PERIODS, base=short(noise={"position": 0.1})), r"timing.noise was \{\}, is \{\"position\": 0.1\}"),
    (study(PERIODS, base=short(stop_time=0.2)), r"stop_time was 0.1, is 0.2"),
    (study(PERIODS, base=dataclasses.replace(short(), seed=3)), r"seed was 0, is 3"),
    (study(PERIODS, base=HEAVY), r"plant.mass was absent, is 1.1"),
    (
        study(PERIODS, base=short(delay=0.1, offset=0.1, jitter=0.001, clock_ratio=1.1, hold="first")),
        r"timing.clock_ratio was 1.0, is 1.1; timing.delay was 0.0, is 0.1; timing.hold was .*; and 2 more\)",
    ),
]


@pytest.mark.parametrize(("changed", "said"), CHANGES, ids=[said.partition(" was")[0] for _, said in CHANGES])
def test_a_changed_study_is_refused_with_the_changes(finished: Path, changed: Study, said: str) -> None:
    before = bits(store_path("study", finished))
    with pytest.raises(UsageError, match=rf"holds another study \({said}") as caught:
        sweep(changed, out=finished)
    assert "expected the same one: take another folder, out, or remove the store" in one_line(caught.value)
    assert bits(store_path("study", finished)) == before


@pytest.mark.parametrize(
    ("place", "said"),
    [("hashes", "FMU of the plant was .*, is other"), ("machine", "machine was Python .*, is a Z80"),
     ("versions", "version of sources was .*, is edited")],
)  # fmt: skip
def test_other_fmus_machines_and_sources_are_a_changed_study(
    finished: Path, monkeypatch: pytest.MonkeyPatch, place: str, said: str
) -> None:
    def other(chosen: Study) -> Files:
        files = files_of(chosen.origin)
        files.__dict__["hashes"] = {**files.hashes, NATIVE.plant.fmu: "other"}
        return files

    edited = {**versions(), "sources": "edited"}
    if place == "hashes":
        monkeypatch.setattr(Study, "files", other)
    elif place == "machine":
        monkeypatch.setattr("orchestration.experiments.studies.run_key.machine", lambda: "a Z80")
    else:
        monkeypatch.setattr("orchestration.experiments.studies.run_key.versions", lambda: edited)
    with pytest.raises(UsageError, match=said):
        sweep(study(PERIODS), out=finished)


def test_another_fmu_at_the_path_of_an_axis_is_a_changed_study_and_a_further_path_is_none(tmp_path: Path) -> None:
    paths = [str(tmp_path / f"{name}.fmu") for name in "ab"]
    for path in paths:
        shutil.copy(locate(NATIVE.controller.fmu), path)
    sweep(study(axis("controller.fmu", paths[0])), out=tmp_path)
    chosen = study(axis("controller.fmu", *paths))
    assert sweep(chosen, out=tmp_path).flown == 0  # by content the same run
    shutil.copy(locate("native/GeometricController"), paths[1])
    with pytest.raises(UsageError, match=r"holds another study \(content of .*b.fmu was "):
        sweep(chosen, out=tmp_path)


def all_rows(path: Path) -> list[dict[str, Any]]:
    with open_for_reading(path) as store:
        return list(store.rows())


GROWN = [
    (study(axis("timing.period", 0.005, 0.01, 0.015, 0.02)), 2),
    (study(axis("timing.period", 0.02)), 0),
    (study(PERIODS, axis("plant.mass", 1.0, 1.1)), 2),  # the first is the mass that the FMU has
    (study(axis("timing.delay", 0.0, 0.001), PERIODS), 2),
]


@pytest.mark.parametrize(("grown", "flown"), GROWN)
def test_a_store_grows_and_keeps_its_rows(finished: Path, tmp_path: Path, grown: Study, flown: int) -> None:
    shutil.copytree(finished, tmp_path, dirs_exist_ok=True)
    path = store_path("study", tmp_path)
    before = {row["key"]: row["duration"] for row in all_rows(path)}
    summary = sweep(grown, out=tmp_path)
    assert (summary.total, summary.flown) == (len(grown.points), flown)
    after = all_rows(path)
    assert [row["settings"] for row in after] == list(grown.points)
    kept = [row for row in after if row["key"] in before]
    assert len(kept) == len(after) - flown
    assert all(row["duration"] == before[row["key"]] for row in kept), "expected none to be flown again"
    for row, index in zip(after, range(len(after)), strict=True):
        direct = run(grown.system(index, starts())).metrics
        assert row["position_rmse"] == direct["position_rmse"]
    assert sweep(study(PERIODS), out=tmp_path).flown == 0, "expected what was taken out to be kept"


def test_more_samples_keep_the_existing_ones_also_with_varying_seeds(tmp_path: Path) -> None:
    mass = Axis(name="mass", targets=("plant.mass",), low=0.9, high=1.1)
    for samples, flown in ((2, 2), (4, 2)):
        chosen = study(mass, base=short(noise={"position": 0.01}), samples=samples, vary_seed=True)
        assert sweep(chosen, out=tmp_path).flown == flown


def test_the_name_of_a_study_and_the_signals_that_it_keeps_may_change(finished: Path) -> None:
    renamed = dataclasses.replace(study(PERIODS, keep_signals=(1,)), name="renamed")
    assert sweep(renamed, out=finished).total == 2


def test_axes_of_seeds_run_those_seeds(tmp_path: Path) -> None:
    noisy = short(noise={"position": 0.01})
    rows = bits(swept(study(axis("seed", 4, 9, 4), base=noisy), tmp_path))
    assert [row["seed"] for row in rows] == [4, 9, 4]
    assert rows[0]["position_rmse"] == rows[2]["position_rmse"] != rows[1]["position_rmse"]
    assert rows[0]["key"] == rows[2]["key"] != rows[1]["key"]


# -- runs that fail and runs that diverge -----------------------------------------------------------------


def test_a_run_that_fails_is_a_row_with_its_message_and_is_repeated_on_request_only(tmp_path: Path) -> None:
    chosen = study(axis("plant.mass", 1.0, FAILS, 2.0))
    path = swept(chosen, tmp_path)
    rows = bits(path)
    assert [row["status"] for row in rows] == ["done", "failed", "done"]
    assert rows[1]["message"].endswith("mass = 0.0: expected a finite value > 0")
    assert sweep(chosen, out=tmp_path).flown == 0
    again = sweep(chosen, out=tmp_path, retry_failed=True)
    assert (again.flown, again.failed) == (1, 1)
    assert bits(path) == rows


def test_runs_that_fail_and_diverge_have_the_same_rows_with_two_workers(tmp_path: Path) -> None:
    base = short(stop_time=20.0, plant_interval=0.1)
    chosen = study(axis("plant.mass", 1.0, FAILS, 1.1), axis("timing.period", 0.05, 0.2), base=base)
    rows = bits(swept(chosen, tmp_path, workers=2))
    assert "diverged" in {row["outcome"] for row in rows}
    assert [row["status"] for row in rows] == ["done"] * 2 + ["failed"] * 2 + ["done"] * 2
    for row, index in zip(rows, range(6), strict=True):
        if row["status"] == "done":
            direct: dict[str, Any] = run(chosen.system(index, starts())).metrics
            assert row["outcome"] == direct["outcome"]
            assert row["steps"] == float(direct["steps"]).hex()


@pytest.mark.parametrize(
    ("chosen", "said"),
    [
        (study(axis("plant.weight", 1.0)), "(plant.weight = 1.0): plant.weight: QuadrotorPlant has no"),
        (study(axis("plant.mas", 1.0, 2.0)), "QuadrotorPlant has no such variable; did you mean mass? its"),
        (study(axis("plant.mass", 1.0, -1.0)), "run 1 (plant.mass = -1.0): plant.mass = -1.0: expected at least 0"),
        (study(axis("plant.mass", "heavy")), "plant.mass = heavy: expected a number"),
        (study(axis("plant.mass", True)), "plant.mass = True: expected a number"),
        (study(axis("plant.position.x", 1.0)), "plant.position.x: is an output; expected a parameter"),
        (study(axis("plant.tilt", 1.0)), "plant.tilt: is a continuous local variable; expected a parameter, an input"),
        (study(axis("timing.period", 0.01, -0.01)), "timing.period = -0.01: expected a positive number"),
        (study(axis("timing.jitter", 0.001, 0.02), base=short(period=0.01)), "run 1 (timing.jitter = 0.02): timing."),
        (study(axis("timing.noise.posit", 0.1)), "timing.noise: posit is no signal"),
        (study(axis("stop_time", 1.0, -1.0)), "stop_time = -1.0: expected a positive number"),
        (study(PERIODS, base=dataclasses.replace(short(), record=Record(plant=("speed",)))), "record.plant: Quadrotor"),
    ],
)  # fmt: skip
def test_a_design_with_an_invalid_run_is_refused_before_any_run(tmp_path: Path, chosen: Study, said: str) -> None:
    with pytest.raises(UsageError) as caught:
        sweep(chosen, out=tmp_path)
    assert said in one_line(caught.value)
    assert len(one_line(caught.value)) < 500
    assert list(tmp_path.iterdir()) == []


# -- signals ----------------------------------------------------------------------------------------------


def test_signals_of_the_chosen_runs_are_kept_and_are_those_of_a_direct_run(tmp_path: Path) -> None:
    chosen = study(axis("timing.period", 0.01, 0.02, 0.03), base=short(noise={"velocity": 0.1}), keep_signals=(1, 2))
    swept(chosen, tmp_path)
    keys = [row["key"] for row in all_rows(store_path("study", tmp_path))]
    kept = [tmp_path / "signals" / f"{key[:16]}.parquet" for key in keys[1:]]
    assert sorted((tmp_path / "signals").iterdir()) == sorted(kept)
    for index, path in zip((1, 2), kept, strict=True):
        table = pq.read_table(path)
        direct = run(chosen.system(index, starts()))
        assert tuple(table.column_names) == direct.columns
        kept_rows = np.column_stack([table[name].to_numpy() for name in table.column_names])
        assert np.array_equal(kept_rows, direct.rows)


def test_no_signals_are_kept_by_default_and_runs_are_repeated_for_signals_requested_later(tmp_path: Path) -> None:
    chosen = study(axis("timing.period", 0.01, 0.02))
    swept(chosen, tmp_path)
    assert not (tmp_path / "signals").exists()
    summary = sweep(dataclasses.replace(chosen, keep_signals=(1,)), out=tmp_path)
    assert summary.flown == 1
    assert len(list((tmp_path / "signals").iterdir())) == 1


# -- a few runs at a time ---------------------------------------------------------------------------------


def test_an_evaluator_runs_in_order_up_to_the_first_that_stops_it_with_any_number_of_workers() -> None:
    scenarios = [short(period=period).as_system() for period in (0.01, 0.02, 0.03)]
    with engine.RunEvaluator(files_in(), 1) as pool:
        everything = pool.run_until(scenarios, stop=lambda metrics: False)
        first = pool.run_until(scenarios, stop=lambda metrics: True)
    with engine.RunEvaluator(files_in(), 2) as pool:
        by_two = pool.run_until(scenarios, stop=lambda metrics: False)
    expected = [run(scenario).metrics["position_rmse"] for scenario in scenarios]
    assert [metrics["position_rmse"] for metrics in everything] == expected
    assert [metrics["position_rmse"] for metrics in first] == expected[:1]
    assert sorted(repr(metrics["position_rmse"]) for metrics in by_two) == sorted(map(repr, expected))


def test_an_evaluator_raises_the_error_of_a_failed_run() -> None:
    bad = short().with_changes(parameters={"plant.mass": -1.0}).as_system()
    with engine.RunEvaluator(files_in(), 1) as pool, pytest.raises(QuadcosimError, match=r"mass = -1.0: expected"):
        pool.run_until([bad], stop=lambda metrics: False)


# -- usage ------------------------------------------------------------------------------------------------


def test_without_workers_a_sweep_is_refused(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="workers = 0: expected at least 1"):
        sweep(study(PERIODS), out=tmp_path, workers=0)


def test_the_store_describes_its_study(finished: Path) -> None:
    models = files_in().models_of(short().as_system())
    with open_for_reading(store_path("study", finished)) as store:
        about = store.about()
    assert about["total"] == "2"
    assert json.loads(about["axes"]) == ["timing.period"]
    assert json.loads(about["grid"]) == {"timing.period": [0.01, 0.02]}
    assert json.loads(about["guids"]) == {name: model.description.guid for name, model in models.items()}
    assert json.loads(about["place"])["machine"] == machine()
    assert {row["machine"] for row in all_rows(store_path("study", finished))} == {machine()}
    assert {"quadcosim", "numpy", "fmpy"} <= json.loads(about["versions"]).keys()
