"""The examples and studies, written where there is no checkout."""

from pathlib import Path

import pytest

from orchestration.components.building import consent
from orchestration.components.scaffold import examples
from orchestration.experiments.studies.study_file import load_study
from tests.commands import Main
from tests.places import ROOT


def test_what_pages_name_is_written_and_runs(main: Main, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    done = main("examples", "--out", "mine")
    assert done.stdout.splitlines() == [str(Path("mine") / name) for name in examples.FOLDERS]
    assert "quadcosim run" in done.stderr
    for name in ("examples/quadrotor/study.toml", "studies/comparisons/laws.toml", "gains/unified_10ms.toml"):
        assert (tmp_path / "mine" / name).read_bytes() == (ROOT / name).read_bytes()
    assert load_study(Path("mine/examples/quadrotor/study.toml")).points
    assert not [*Path("mine").rglob("*.fmu")]
    assert not [*Path("mine").rglob("__pycache__")]
    main("run", Path("mine/examples/double_integrator/system.toml"), "--stop-time", "0.1", "--no-figures")


def test_the_modules_of_written_examples_may_be_built(tmp_path: Path) -> None:
    examples.write(tmp_path)
    with consent.asking(lambda question: pytest.fail(question)):
        consent.expect(Path("Tank.fmu"), tmp_path / "examples" / "water_tank")


def test_nothing_is_written_over(main: Main, tmp_path: Path) -> None:
    (tmp_path / "studies").mkdir()
    line = main("examples", "--out", tmp_path, code=2).stderr
    assert f"{tmp_path / 'studies'}: exists already; expected a folder that does not exist" in line
    assert not (tmp_path / "examples").exists()


def test_a_wheel_carries_what_is_written() -> None:
    said = (ROOT / "setup.py").read_text(encoding="utf-8")
    assert f"{examples.FOLDERS!r}, {examples.KEPT!r}".replace("'", '"') in said
