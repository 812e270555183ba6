"""Studies from Python: functions that give tables, with workers that need no guard of the main module."""

import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest

import quadcosim
from orchestration.simulation.figures.style import STYLES
from quadcosim import Axis, QuadcosimError, Result, Scenario, Study, Swept, Timing, UsageError
from tests.orchestration.experiments.tuning.test_tuning import FILE
from tests.patience import PATIENCE
from tests.places import EXAMPLES
from tests.quadcosim.conftest import native

PERIODS = Axis(name="timing.period", values=(0.01, 0.02))
STUDY = Study(name="periods", base=native(stop_time=0.1), axes=(PERIODS,))


@pytest.fixture(scope="module")
def swept(tmp_path_factory: pytest.TempPathFactory) -> Swept:
    return quadcosim.sweep(STUDY, out=tmp_path_factory.mktemp("study"), progress=None)


def test_a_sweep_becomes_a_table_with_units_of_axes_and_metrics(swept: Swept) -> None:
    table = swept.to_pandas()
    assert table["timing.period"].tolist() == [0.01, 0.02]
    assert table["position_rmse"].notna().all()
    units = table.attrs["units"]
    assert (units["timing.period"], units["position_rmse"]) == ("s", "m")
    assert swept.to_xarray()["position_rmse"].attrs["units"] == "m"


def test_a_sweep_is_not_flown_twice_and_tells_its_progress(swept: Swept) -> None:
    reported: list[tuple[int, int]] = []
    again = quadcosim.sweep(STUDY, out=swept.path.parent, progress=lambda done, total: reported.append((done, total)))
    assert (again.total, again.flown, reported) == (2, 0, [(2, 2)])
    assert repr(again) == f"<Swept: 2 runs, 0 of them new, in {again.path}>"


def test_a_report_is_of_what_python_has_returned_or_of_what_it_was_made_of(swept: Swept, tmp_path: Path) -> None:
    axis = {"name": "timing.period", "values": [0.01, 0.02]}
    content = {"name": "periods", "base": native(stop_time=0.1), "axes": [axis]}
    written = [
        quadcosim.report(what, out=tmp_path / "a.html", store=store, flights=1).read_text()
        for what, store in ((swept, None), (STUDY, swept.path.parent), (content, swept.path))
    ]
    assert written[0] == written[1] == written[2]
    assert quadcosim.report(swept, out=tmp_path, flights=1) == tmp_path / "report_periods.html"
    with pytest.raises(
        UsageError, match="report: 3: expected a Result, a Study, a Comparison or what sweep or compare"
    ):
        quadcosim.report(3)  # type: ignore[arg-type]
    with pytest.raises(UsageError, match="store: expected a study file or a comparison file with it"):
        quadcosim.report(swept.path, out=tmp_path / "b.html", store=tmp_path)


MARGIN = 2.0


def furthest(result: Result) -> float:
    # a comment, and annotations, are no part of what is run
    return float(np.abs(result.signals["plant.position.x"]).max())


def test_functions_of_a_result_are_metrics_of_a_sweep_known_by_their_source(tmp_path: Path) -> None:
    def nearest(result):
        return np.abs(result.signals["plant.position.x"]).min()

    def coarse(result):
        return None if len(result.events) > 22 else len(result.events)

    metrics = {"furthest": furthest, "nearest": nearest, "coarse": coarse}
    found = quadcosim.sweep(STUDY, metrics=metrics, out=tmp_path, progress=None)
    table = found.to_pandas()
    assert (table["furthest"] >= table["nearest"]).all()
    alone = [quadcosim.run(native(stop_time=0.1, timing=Timing(period=period))) for period in (0.01, 0.02)]
    assert table["furthest"].tolist() == [furthest(result) for result in alone]
    assert table["coarse"].isna().tolist() == [True, False]
    assert list(found.plot("furthest")) == ["furthest"]
    assert quadcosim.sweep(STUDY, metrics=metrics, out=tmp_path, progress=None).flown == 0
    with pytest.raises(UsageError, match=r"holds another study \(metrics.nearest was .*\); expected the same one"):
        quadcosim.sweep(STUDY, metrics={**metrics, "nearest": furthest}, out=tmp_path, progress=None)


def _uses_what_is_around(result):
    return MARGIN * result.end


def _of_two(result, other):
    return 1.0


def _scaled(scale):
    def enclosed(result):
        return scale * result.end

    return enclosed


@pytest.mark.parametrize(
    ("function", "message"),
    [
        (_uses_what_is_around, "MARGIN is not in it: expected all that it uses in the function, but for modules"),
        (_of_two, "expected a function of one argument, a Result, defined by def"),
        (max, "has no source: expected a function of one argument"),
        (_scaled(2.0), "scale is not in it: expected all that it uses in the function"),
        (lambda result: 1.0, "expected a function of one argument, a Result, defined by def"),
        (3, "has no source"),
    ],
    ids=["global", "two", "builtin", "enclosed", "lambda", "number"],
)
def test_a_function_whose_source_is_not_self_contained_is_refused(function: Any, message: str) -> None:
    with pytest.raises(UsageError, match=f"^metrics.own: .*{message}"):
        quadcosim.sweep(STUDY, metrics={"own": function})


def test_functions_and_lanes_do_not_go_together_and_an_error_in_one_is_that_of_its_run(tmp_path: Path) -> None:
    with pytest.raises(
        UsageError, match=r"^engine = batch: metrics that are functions need whole runs, one at a time$"
    ):
        quadcosim.sweep(STUDY, metrics={"furthest": furthest}, engine="batch")

    def broken(result):
        return result.signals["no.such"]

    lines: list[str] = []
    quadcosim.sweep(STUDY, metrics={"broken": broken}, out=tmp_path, progress=None, announce=lines.append)
    failed = (
        "run 1 (timing.period = 0.02) failed: metrics.broken: UnknownNameError: there is no no.such; expected one of "
    )
    assert lines[-1].startswith(f"{failed}time, plant.thrust, ")


def test_a_notebook_shows_what_became_of_the_runs(swept: Swept) -> None:
    assert ">bounded<" in swept._repr_html_()
    assert ">2<" in swept._repr_html_()
    assert swept.verdict == "2 bounded of 2 runs"


def test_a_sweep_draws_what_its_criterion_is_about_or_what_is_asked_for(swept: Swept) -> None:
    assert list(swept.plot()) == ["ultimate_bound"]
    figures = swept.plot("position_rmse")
    (panel,) = figures["position_rmse"].axes
    assert panel.get_xlabel() == "period [ms]"
    assert figures._repr_html_().startswith("<img")
    with pytest.raises(UsageError, match="metric beauty: expected one of"):
        swept.plot("beauty")


def test_the_rows_of_a_study_say_the_unit_of_an_axis_in_parquet_and_mat(swept: Swept) -> None:
    from scipy.io import loadmat

    from orchestration.experiments.studies.table import of_study

    parquet, mat = of_study(swept.path, ("parquet", "mat"))
    assert pq.read_schema(parquet).field("timing.period").metadata[b"unit"] == b"s"
    found = loadmat(mat, simplify_cells=True)
    assert found["runs"]["timing_period"].tolist() == [0.01, 0.02]
    assert (found["units"]["timing_period"], found["units"]["position_rmse"]) == ("s", "m")
    assert list(found["runs"]["outcome"]) == ["bounded", "bounded"]


SCRIPT = """
import quadcosim
from quadcosim import Axis, Scenario, Study
base = Scenario(stop_time={stop}).with_fmus(plant="native/QuadrotorPlant", controller="native/UnifiedController")
study = Study(name="seeds", base=base, axes=(Axis(name="seed", values=tuple(range({runs}))),))
say = lambda done, total: print("done", done, flush=True)
quadcosim.sweep(study, out={folder!r}, workers=2, engine="compiled", progress=say)
"""


def script(folder: Path, *, runs: int, stop: float) -> subprocess.Popen[str]:
    """A program without a guard of its main module, from standard input as a notebook's cell is from a socket."""
    process = subprocess.Popen(
        [sys.executable, "-"], stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    assert process.stdin is not None
    process.stdin.write(SCRIPT.format(folder=str(folder), runs=runs, stop=stop))
    process.stdin.close()
    process.stdin = None
    return process


@pytest.mark.skipif(sys.platform == "win32", reason="signals of POSIX")
def test_workers_need_no_guard_of_the_main_module_and_ctrl_c_keeps_what_was_flown(tmp_path: Path) -> None:
    with script(tmp_path, runs=2000, stop=0.5) as process:
        assert process.stdout is not None
        while process.stdout.readline() != "done 1\n":
            assert process.poll() is None
        process.send_signal(signal.SIGINT)
        _, err = process.communicate(timeout=PATIENCE)
    assert process.returncode != 0
    assert "of 2000 runs done" in err.splitlines()[-1]
    assert (tmp_path / "study.sqlite").is_file()


def test_a_limit_is_a_table_of_what_was_tried() -> None:
    tank = EXAMPLES / "water_tank" / "system.toml"
    system = quadcosim.changed(quadcosim.load_system(tank), {"stop_time": 5.0})
    told = list[str]()
    found = quadcosim.limit(
        system, "connections.valve.delay", first=0.0, last=0.2, scan=0.1, tolerance=0.05, announce=told.append
    )
    assert found.to_pandas()["value"].tolist() == [one.value for one in found.tried]
    assert repr(found) == f"<Limit: {found.verdict}>"
    assert "connections.valve.delay 100 ms: good" in told
    assert "last value that is good" in found._repr_html_()
    figure = found.plot(style="paper")["limit"]
    assert figure.get_figwidth() == pytest.approx(STYLES["paper"].width / 25.4)
    assert any("the criterion's bound" in str(line.get_label()) for line in figure.axes[0].get_lines())
    with pytest.raises(quadcosim.UsageError, match="style poster: expected one of screen, paper, slides"):
        found.plot(style="poster")  # type: ignore[arg-type]


def test_a_tuning_gives_its_searches_and_writes_their_files(tmp_path: Path) -> None:
    text = FILE.replace("stop_time = 5.0", "stop_time = 0.05").replace("evaluations = 100", "evaluations = 1")
    (tmp_path / "few.toml").write_text(text.replace("seeds = [1, 2]", "seeds = [1]"))
    found = quadcosim.tune(
        tmp_path / "few.toml",
        out=tmp_path / "gains",
        folder=tmp_path / "kept",
        progress=None,
        announce=None,
    )
    assert [path.name for path in found.written] == ["few_10ms.toml", "few_20ms.toml"]
    assert found.to_pandas()["period"].tolist() == [0.01, 0.02]
    assert set(found.best) == {0.01, 0.02}
    assert found.verdict.startswith("best of 2 searches: 10 ms cost ")
    assert "controller.gain.attitude" in found.to_pandas()
    assert "by: quadcosim.tune" in found.written[0].read_text()


def test_what_cannot_be_is_refused_in_a_line_before_anything_is_flown(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=r"timing.perio: expected .*KEY one of period"):
        Study(name="x", base=Scenario(), axes=(Axis(name="timing.perio", values=(0.1,)),))
    folder: Any = 3
    with pytest.raises(UsageError, match=r"^out = 3: expected the path of a folder$"):
        quadcosim.sweep({"name": "x", "base": Scenario(), "axes": [{"name": "seed", "values": [1]}]}, out=folder)


def test_without_a_package_of_an_extra_one_line_names_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "filelock", None)
    with pytest.raises(QuadcosimError, match=r"^filelock is not installed; .*quadcosim\[studies\]'$"):
        quadcosim.sweep(STUDY, out=tmp_path, progress=None)
