"""The file of a report: whole in itself, and of what is refused nothing is written."""

import dataclasses
import json
import re
from pathlib import Path
from typing import Any

import pytest

from orchestration.experiments.report import of_runs
from orchestration.experiments.report.model import Report, ReportRun
from orchestration.experiments.report.writing import as_html
from orchestration.experiments.report.writing import report as write
from orchestration.simulation.runs.simulation import run
from quadcosim import Timing
from tests.commands import Main
from tests.native import NATIVE

NASTY = "</script><script>alert('!')</script> & \u2028 \"quoted\" <b>"


def report(**fields: object) -> Report:
    empty = Report(
        kind="runs", title="run", summary="", words=("good", "bad"), layouts=(), runs=(ReportRun(name="run"),), blobs=()
    )
    return dataclasses.replace(empty, **fields)  # type: ignore[arg-type]


def document(text: str) -> dict[str, Any]:
    found = re.search(r'<script type="application/json" id="data">(.*?)</script>', text, re.DOTALL)
    assert found is not None
    read: dict[str, Any] = json.loads(found[1])
    return read


def test_names_are_in_the_file_as_they_are_and_end_no_element() -> None:
    text = as_html(report(title=NASTY, runs=(ReportRun(name=NASTY),), command=NASTY))
    assert document(text)["title"] == NASTY
    assert "<script>alert" not in text
    assert text.count("</script>") == 2


def test_what_is_not_finite_is_null() -> None:
    text = as_html(report(runs=(ReportRun(name="run", metrics={"a": float("nan"), "b": float("inf"), "c": 1.5}),)))
    assert document(text)["runs"][0]["metrics"] == {"a": None, "b": None, "c": 1.5}


def test_the_page_forbids_itself_to_load_anything() -> None:
    text = as_html(report())
    assert "default-src 'none'" in text
    assert "unsafe-eval" not in text
    assert not re.search(r"""(src|href)=["']?(https?:)?//""", text)


def test_a_run_of_the_paper_is_under_a_megabyte(tmp_path: Path) -> None:
    assert write(run(NATIVE), out=tmp_path / "report.html").stat().st_size < 1_000_000


@pytest.mark.parametrize(
    ("stop_time", "period", "said"),
    [(9.0, 0.01, "r: settled in 4.98 s"), (1.0, 0.01, "r: bounded in a run of 1 s"), (3.0, 0.2, "r: diverged at ")],
)
def test_the_summary_has_the_outcome_of_a_run_and_its_time(stop_time: float, period: float, said: str) -> None:
    flown = run(dataclasses.replace(NATIVE, stop_time=stop_time, timing=Timing(period=period)))
    assert of_runs.runs_report({"r": flown}, "").summary.startswith(said)


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["nothing"], "nothing: expected the directory of a run, a study file or its store, or a comparison file"),
        (["empty", "empty"], "empty: expected the directory of a run, a study file or its store"),
        (["study.toml", "study.toml"], "study.sqlite: expected the store of a study; there is no such file"),
        (["study.toml"], "study.sqlite: expected the store of a study; there is no such file"),
        (["study.toml", "--out", "here.pdf"], "--out here.pdf: expected a file that ends in .html"),
    ],
)
def test_what_is_no_run_and_no_study_is_refused_in_one_line(
    main: Main, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, arguments: list[str], said: str
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "empty").mkdir()
    (tmp_path / "study.toml").write_text('[[axes]]\nname = "period"\nsets = ["timing.period"]\nvalues = [0.01]\n')
    done = main("report", *arguments, code=2)
    assert said in done.stderr
    assert done.stderr.count("\n") == 1
    assert not list(tmp_path.glob("*.html"))
