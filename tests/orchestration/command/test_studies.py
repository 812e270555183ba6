"""The commands of studies as a user starts them."""

import json
import re
import shutil
from pathlib import Path

import pandas as pd
import pytest

from orchestration.experiments.studies.store import store_path
from tests.commands import Done, Main
from tests.orchestration.experiments.studies.common import (
    GRID,
    NOISY,
    RUNS,
    STORE,
    error_line,
    kill,
    quadcosim,
    start,
    wait_for_rows,
)

LONG = NOISY.replace("stop_time = 0.2", "stop_time = 5.0")  # is killed before it ends
LIMIT = ("limit", "--native", "--plant-interval", "0.01", "--stop-time", "0.05", "--set", "plant.wind.amplitude.x=0")


@pytest.fixture(autouse=True)
def _here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """The current folder, with a study of six runs."""
    (tmp_path / "study.toml").write_text(GRID)
    return tmp_path


@pytest.fixture(scope="module")
def swept(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Done]:
    """A folder with that study, flown, and what the command said."""
    elsewhere = tmp_path_factory.mktemp("swept")
    (elsewhere / "study.toml").write_text(GRID)
    return elsewhere, quadcosim("sweep", "study.toml", "--engine", "compiled", cwd=elsewhere)


@pytest.fixture
def flown(swept: tuple[Path, Done], folder: Path) -> Path:
    """The current folder, with that study flown."""
    shutil.copytree(swept[0], folder, dirs_exist_ok=True)
    return folder


# -- sweep, status, export, draw --------------------------------------------------------------------------


def test_a_study_is_run_inspected_and_exported(flown: Path, swept: tuple[Path, Done], main: Main) -> None:
    answer = "6 bounded of 6 runs"
    assert swept[1].stdout == f"{answer}\n{STORE}: 6 runs, 6 of them new\n"
    told = [line for line in swept[1].stderr.splitlines() if " of 6 runs" not in line]  # or how far, if slow
    assert told.pop(0).startswith("engine compiled: slow, as QuadrotorPlant, UnifiedController run Python; ")
    assert told == ["follows the trajectory that UnifiedController has built in"]
    for where in ((), ("--store", STORE.parent), ("--store", STORE), ("--out", STORE.parent)):
        shown = main("status", "study.toml", *where).stdout
        assert shown == f"{answer}\n{STORE}: 6 of 6 runs, 0 failed, 0 missing\n"
    exported = main("export", "study.toml").stdout.splitlines()
    assert exported == [str(STORE.parent / "runs.parquet"), str(STORE.parent / "runs.csv")]
    parquet = pd.read_parquet(flown / exported[0])
    assert parquet["period"].tolist() == [0.02] * 3 + [0.01] * 3
    assert len(pd.read_csv(flown / exported[1])) == 6
    placed = main("export", "study.toml", "--store", STORE.parent, "--out", "there", "--format", "csv").stdout
    assert placed == f"{Path('there', 'runs.csv')}\n"


def test_a_store_goes_to_the_given_folder_and_figures_beside_it(folder: Path, main: Main) -> None:
    text = (folder / "study.toml").read_text().partition('[[axes]]\nname = "delay"')[0]
    (folder / "study.toml").write_text(text)
    main("sweep", "study.toml", "--out", "elsewhere", "--workers", "1")
    assert store_path("study", folder / "elsewhere").is_file()
    drawn = main("draw", "study.toml", "--out", "elsewhere", "--metric", "position_rmse")
    pictures = [str(Path("elsewhere") / f"position_rmse.{ending}") for ending in ("png", "svg")]
    assert drawn.stdout.splitlines() == pictures
    assert (folder / "elsewhere" / "position_rmse.png").read_bytes().startswith(b"\x89PNG")
    assert not (folder / "results").exists()


def test_status_tells_how_far_a_sweep_in_another_process_is(folder: Path, main: Main) -> None:
    (folder / "study.toml").write_text(LONG)
    with start("sweep", "study.toml", "--engine", "compiled", cwd=folder) as running:
        wait_for_rows(folder / STORE, 1)
        told = main("status", "study.toml").stdout
        assert running.poll() is None
        kill(running.pid)
    state = rf"{STORE}: (\d+) of {RUNS} runs, 0 failed, (\d+) missing; quadcosim sweep study.toml runs them\n"
    found = re.fullmatch(rf"\d+ bounded of {RUNS} runs\n{state}", told)
    assert found is not None, told
    done, missing = map(int, found.groups())
    assert 1 <= done < RUNS
    assert done + missing == RUNS


def test_failed_runs_are_reported_immediately_and_fail_the_command(folder: Path, main: Main) -> None:
    (folder / "study.toml").write_text(GRID + '[[axes]]\nname = "plant.mass"\nvalues = [1.0, 0.0]\n')
    done = main("sweep", "study.toml", "--engine", "compiled", code=1)
    assert "12 runs, 12 of them new, 6 failed (quadcosim export shows why; --retry-failed)" in done.stdout
    told = done.stderr.splitlines()
    assert told.pop() == "follows the trajectory that UnifiedController has built in"
    assert told.pop(0).startswith("warning: the controller's nominal model is not the plant: ")
    assert told.pop(0).startswith("engine compiled: slow")
    assert len(told) == 3
    assert told[0].startswith("run 1 (period = 0.02, delay = 0.0, plant.mass = 0.0) failed: plant.mass = 0.0: ")
    assert told[2].endswith("; further ones are not shown")
    assert "12 of 12 runs, 6 failed, 0 missing" in main("status", "study.toml").stdout
    again = main("sweep", "study.toml", "--engine", "compiled", "--retry-failed", code=1)
    assert "12 runs, 6 of them new, 6 failed" in again.stdout


def test_two_sweeps_at_once_are_refused_in_one_line(folder: Path, main: Main) -> None:
    (folder / "study.toml").write_text(LONG)
    with start("sweep", "study.toml", "--engine", "compiled", cwd=folder) as running:
        wait_for_rows(folder / STORE, 1)
        refused = main("sweep", "study.toml", "--engine", "compiled", code=1)
        kill(running.pid)
    assert error_line(refused) == f"{STORE}: another sweep is writing into it; expected to be the only one"


def test_a_changed_study_is_wrong_usage(flown: Path, main: Main) -> None:
    (flown / "study.toml").write_text(GRID.replace("stop_time = 0.1", "stop_time = 0.2"))
    line = error_line(main("sweep", "study.toml", "--engine", "compiled", code=2))
    assert line.startswith(f"{STORE}: holds another study (stop_time was 0.1, is 0.2)")


@pytest.mark.parametrize("command", ["status", "export", "draw"])
def test_a_changed_study_file_is_refused_and_old_rows_are_not_shown_for_it(
    flown: Path, command: str, main: Main
) -> None:
    for text, said, what_runs_it in (
        (GRID.replace("stop_time = 0.1", "stop_time = 0.2"), "stop_time was 0.1, is 0.2", "with another --out runs it"),
        (GRID.replace("[0.02, 0.01]", "[0.02, 0.03]"), "axis period was ", "runs what is missing"),
    ):
        (flown / "study.toml").write_text(text)
        line = error_line(main(command, "study.toml", code=2))
        assert line.startswith(f"{STORE}: the study file has changed since ({said}")
        assert line.endswith(f"quadcosim sweep {what_runs_it}")
        assert len(line) < 400


def test_a_study_cannot_be_named_out_of_the_folder_of_results(folder: Path, main: Main) -> None:
    for name in ("../evil", "/evil", "a/b", "..", "a\\\\b"):
        (folder / "study.toml").write_text(f'name = "{name}"\n{GRID}')
        line = error_line(main("sweep", "study.toml", code=2))
        assert "expected the name of a folder" in line, line
    assert not (folder.parent / "evil").exists()


@pytest.mark.parametrize("command", ["sweep", "status", "export", "draw"])
def test_a_study_file_that_is_not_there_is_wrong_usage(command: str, main: Main) -> None:
    line = error_line(main(command, "nowhere.toml", code=2))
    assert line.startswith("nowhere.toml: expected a readable study file")


@pytest.mark.parametrize("command", ["status", "export", "draw"])
def test_a_study_without_runs_is_wrong_usage(folder: Path, command: str, main: Main) -> None:
    line = error_line(main(command, "study.toml", code=2))
    assert line == f"{STORE}: expected the store of a study; there is no such file"


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("sweep", "study.toml", "--workers", "0"), "--workers 0: expected at least 1"),
        (("draw", "study.toml", "--metric", "beauty"), "metric beauty: expected one of good, horizon"),
    ],
)
def test_options_that_cannot_be_are_wrong_usage(
    folder: Path, arguments: tuple[str, ...], said: str, main: Main
) -> None:
    assert error_line(main(*arguments, code=2)).startswith(said)


def test_a_store_that_is_none_is_a_failure_in_one_line(folder: Path, main: Main) -> None:
    (folder / STORE).parent.mkdir(parents=True)
    (folder / STORE).write_bytes(b"no database at all " * 50)
    for command in ("sweep", "status", "export"):
        assert "file is not a database" in error_line(main(command, "study.toml", code=1))


# -- limit ------------------------------------------------------------------------------------------------


def test_limit_prints_json_alone_on_standard_output_and_what_it_tries_on_request(main: Main) -> None:
    done = main("--verbose", *LIMIT, "--of", "delay", "--tolerance", "0.01", "--json")
    found = json.loads(done.stdout)
    assert {"local_limit", "large_signal_limit", "tolerance", "confidence"} <= found.keys()
    assert found["tolerance"] == 0.01
    assert found["confidence"] is None
    assert 0.0 < found["local_limit"] < 0.1
    assert found["large_signal_limit"] is None, "the paper's flight begins two metres away"
    tried = [line.partition(": ultimate_bound = ") for line in done.stderr.splitlines() if ": ultimate_bound" in line]
    assert [line[0] for line in tried] == [
        f"delay {value}: fails, bounded" for value in ("0 s", "5 ms", "10 ms", "15 ms", "20 ms")
    ]
    assert all(line[2].endswith(" m, expected < 0.05 m") for line in tried)
    assert [one["outcome"] for one in found["tried"]] == ["bounded"] * 5


def test_limit_takes_the_flags_of_a_flight(main: Main) -> None:
    still = [f"--set=controller.trajectory.{name}=0" for name in ("amplitude_x", "amplitude_y", "start_z", "rate_z")]
    tilted = [f"--set=plant.initial.quaternion.{name}=0" for name in "xyz"] + ["--set=plant.initial.quaternion.w=1"]
    flags = ("--of", "loss", "--confidence", "0.1", "--seed", "3", "--json")
    done = main(*LIMIT, *still, *tilted, *flags)
    found = json.loads(done.stdout)
    assert (found["of"], found["confidence"], found["seeds"]) == ("loss", 0.1, 1)
    assert "good throughout the scan, up to 1" in found["verdict"]
    assert len(found["tried"]) == 21
    assert not done.stderr, "values that are tried are told where a bar is drawn, or on request"


def test_limit_prints_both_figures_notes_that_they_differ_and_draws_them_on_request(tmp_path: Path, main: Main) -> None:
    done = main(*LIMIT, "--out", "drawn")
    names = ("limit_period.png", "limit_period.svg", "spectral_radius_period.png", "spectral_radius_period.svg")
    pictures = [Path("drawn") / name for name in names]
    assert done.stderr.splitlines()[-4:] == [*map(str, pictures)]
    for picture in pictures:
        assert (tmp_path / picture).read_bytes().startswith((b"\x89PNG", b"<?xml"))
    answer, *lines = done.stdout.splitlines()
    assert re.fullmatch(
        r"period not good even at \S+ ms, where the scan begins: bounded, ultimate_bound = \S+ m, expected < 0\.05 m "
        r"\(scan 5 ms, tolerance \S+ ms\)",
        answer,
    )
    notes = [line.removeprefix("note: ") for line in lines if line.startswith("note: ")]
    found = {line.split()[0]: line.split(maxsplit=1)[1] for line in lines[: -len(notes)]}
    local, unit = found["local_limit"].split()
    assert (float(local), unit) == (pytest.approx(80.0, abs=0.5), "ms")
    assert found["large_signal_limit"] == "-"
    assert not {"continuous", "flies_above", "refuted_limit", "confidence"} & found.keys()
    assert (found["horizon"], found["scan"], found["tried"]) == ("50 ms", "5 ms", "6 values")
    known, local, own = notes[-3:]
    assert known.endswith("beyond that nothing is known")
    assert local == f"the local limit is {found['local_limit']}"
    assert own == "the file's own value, 10 ms, is not good either"


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("--of", "mass"), "--of mass: expected one of period, delay, jitter, loss"),
        (("--tolerance", "0"), "--tolerance 0.0: expected a positive number"),
        (("--confidence", "1"), "--confidence 1.0: expected a number between 0 and 1"),
        (("nowhere.toml",), "nowhere.toml: expected a readable system or scenario file"),
        (("--period", "-1"), "timing.period = -1.0: expected a positive number"),
    ],
)
def test_a_limit_that_cannot_be_asked_for_is_wrong_usage(arguments: tuple[str, ...], said: str, main: Main) -> None:
    assert error_line(main("limit", *arguments, code=2)).startswith(said)
