"""`quadcosim compare` from a file to tables and pictures, and back to one cell and one flight."""

import json
from dataclasses import replace
from io import StringIO
from pathlib import Path

import pandas as pd
import pytest

import quadcosim
from orchestration.components.fmi.reuse import Instances
from orchestration.experiments.comparison.cells import CellSummary, Median, Share
from orchestration.experiments.comparison.file import load_comparison
from orchestration.experiments.comparison.run import agree
from orchestration.experiments.report.of_comparison import comparison_report
from orchestration.experiments.report.subset import Wanted
from orchestration.quadrotor.flight.hover import COORDINATES, hover_of
from orchestration.quadrotor.flight.hover_loop import controller_at_hover, crossover, located
from quadcosim import FmuChoice, Scenario, UsageError
from tests.commands import Main
from tests.pictures import blank_pictures

FILE = Path(__file__).with_name("test_compare.toml").read_text(encoding="utf-8")
CELLS = 8


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("comparison")
    (path / "small.toml").write_text(FILE)
    return path


@pytest.fixture(scope="module")
def table(folder: Path, module_main: Main) -> str:
    """What the command prints."""
    command = ("compare", folder / "small.toml", "--native", "--format", "png", "--out", folder / "out")
    with blank_pictures():
        return module_main(*command).stdout


@pytest.fixture(scope="module")
def module_main() -> Main:
    import contextlib
    import io

    from orchestration.command import cli
    from tests.commands import Done

    def call(*arguments: str | Path, code: int = 0) -> Done:
        out, err = io.StringIO(), io.StringIO()
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err), pytest.raises(SystemExit) as end:
            cli.main([*map(str, arguments)])
        assert (end.value.code or 0) == code, out.getvalue() + err.getvalue()
        return Done(arguments, code, out.getvalue(), err.getvalue())

    return call


def test_tables_tell_each_cell_and_pictures_are_drawn(table: str, folder: Path) -> None:
    cells = pd.read_csv(folder / "out" / "cells.csv")
    assert [*cells["cell"]] == [*range(CELLS)]
    assert cells["count"].eq(6).all()
    fast = cells[(cells["period"] == 0.02) & (cells["condition"] == "nominal")]
    assert fast["survives"].gt(0).all()
    assert cells[cells["period"] == 0.1]["settles"].eq(0).all()
    assert fast["torque_max"].notna().all()
    for _, cell in fast.iterrows():
        assert (
            f"{cell['survives']} / {cell['settles']}  {cell['survives.share']:.3f} [{cell['survives.low']:.3f}" in table
        )
    pd.testing.assert_frame_equal(pd.read_parquet(folder / "out" / "cells.parquet"), cells)
    drawn = {path.stem for path in (folder / "out").glob("*.png")}
    kinds = {
        f"{kind}_base_{condition}"
        for kind in ("basin_survive", "basin_settle", "shares")
        for condition in ("nominal", "noise")
    }
    assert drawn >= {"limits", *kinds}
    assert json.loads((folder / "out" / "comparison.json").read_text())["starts"] == 6


def test_nothing_is_run_twice_and_the_result_stays(table: str, folder: Path, main: Main) -> None:
    before = (folder / "out" / "cells.csv").read_bytes()
    done = main("compare", folder / "small.toml", "--native", "--out", folder / "out", "--no-figures", "--json")
    assert "48 runs, 0 of them new" in done.stderr
    document = json.loads(done.stdout)
    assert len(document["cells"]) == CELLS
    assert document["verdict"].startswith("from half of the starts, over period: coupled survives ")
    assert document["verdict"].endswith("; base, nominal (1 more below)")
    assert (folder / "out" / "cells.csv").read_bytes() == before


@pytest.mark.usefixtures("blank_figures")
def test_python_has_the_pictures_by_name(table: str, folder: Path) -> None:
    native = replace(quadcosim.load_comparison(folder / "small.toml"), native=True)
    found = quadcosim.compare(native, out=folder / "out", figures=False, progress=None, announce=None)
    assert found.summary.flown == 0
    assert found.verdict.startswith("from half of the starts, over period: coupled survives ")
    with pytest.raises(UsageError, match=r"what = 'fronts': .*expected one of cells, limits, pairs, runs"):
        found.to_pandas("fronts")  # type: ignore[arg-type]
    starts, runs = found.to_pandas("starts"), found.to_pandas("runs").query("design_index < 6")
    assert starts.index.name == "start"
    assert (len(starts), [*starts["seed"]]) == (6, [*runs["seed"]])
    system = native.study.system(4, {})
    assert starts.loc[4, "plant.initial.position.x"] == system.components["plant"].parameters["initial.position.x"]
    pairs = found.to_pandas("pairs")
    assert pairs["both"].tolist() == [one.both for one in found.outcome.pairs]
    assert pairs["error.low"].count() == sum(one.error.low is not None for one in found.outcome.pairs)
    assert {*found.plot(style="paper")} == {path.stem for path in (folder / "out").glob("*.png")}


def test_a_rerun_of_one_cell_is_what_is_in_the_store(table: str, folder: Path, main: Main) -> None:
    command = ("compare", folder / "small.toml", "--native", "--cell", "6", "--json", "--out", folder / "out")
    found = json.loads(main(*command).stdout)
    assert (found["controller"], found["condition"], found["value"]) == ("uncoupled", "noise", 0.02)
    assert found["same_as_stored"] is True
    assert found["verdict"] == f"{found['survives']} of 6 runs survive, {found['settles']} settle"


def test_a_cell_with_another_count_or_median_is_not_the_same() -> None:
    median = Median(value=1.0, low=0.9, high=None)
    cell = CellSummary(
        cell=0, vehicle="v", condition="c", controller="k", value=0.01, count=6, survives=Share.of(5, 6),
        settles=Share.of(4, 6), diverged=1, diverged_late=0, medians={"torque_max": median},
    )  # fmt: skip
    assert agree(cell, cell)
    assert agree(cell, replace(cell, medians={"torque_max": replace(median, value=1.0 + 1e-12)}))
    for other in (
        replace(cell, settles=Share.of(3, 6)),
        replace(cell, medians={"torque_max": replace(median, value=1.0 + 1e-6)}),
        replace(cell, medians={"torque_max": replace(median, high=2.0)}),
    ):
        assert not agree(cell, other)


def test_one_flight_of_a_cell_is_kept_as_that_of_a_scenario(table: str, folder: Path, main: Main) -> None:
    one = ("--cell", "4", "--start", "2", "--no-figures", "--out", folder / "flight")
    main("compare", folder / "small.toml", "--native", *one)
    assert not [*(folder / "flight").glob("*.png")]
    runs = pd.read_csv(folder / "out" / "runs.csv")
    (row,) = runs[runs["design_index"] == 4 * 6 + 2].to_dict("records")
    assert (row["condition"], row["controller"], row["period"], row["start"]) == ("noise", "coupled", 0.02, 2)
    kept = json.loads((folder / "flight" / "metrics.json").read_text())
    again = json.loads(main("run", folder / "flight" / "scenario.toml", "--json").stdout)
    for name in ("position_rmse", "torque_max", "total_variation.torque"):
        assert kept[name] == again[name] == pytest.approx(row[name], rel=1e-12)


def test_a_start_without_its_cell_is_wrong_usage(folder: Path, main: Main) -> None:
    assert "--start: expected --cell K" in main("compare", folder / "small.toml", "--start", "1", code=2).stderr
    for flags, words in (
        (("--cell", "99"), "--cell 99: expected a number from 0 to 7"),
        (("--workers", "0"), "at least 1"),
    ):
        done = main("compare", folder / "small.toml", "--native", *flags, code=2)
        assert words in done.stderr
        assert done.stderr.count("\n") == 1


def test_an_invalid_parameter_is_reported_with_its_controller(folder: Path, main: Main) -> None:
    wrong = folder / "wrong.toml"
    wrong.write_text(FILE.replace("coupling = 0.0", 'discretisation = "meen"'))
    line = main("compare", wrong, "--native", "--out", folder / "wrong", code=2).stderr
    assert "controller = uncoupled" in line
    assert "controller.discretisation = meen: did you mean mean? expected one of explicit" in line


# -- bandwidth ----------------------------------------------------------------------------------------------------

LAW = FmuChoice(fmu="native/UnifiedController", parameters={"coupling": 0.0})
PLANT = FmuChoice(fmu="native/QuadrotorPlant")


def test_at_the_bandwidth_the_open_loop_of_roll_has_the_gain_one() -> None:
    """By the derivatives of the command about hover, where the law has no memory: (k_Omega s + k_q) / (J s^2)."""
    scenario = Scenario(controller=LAW, plant=PLANT).with_changes(timing={"period": 1e-3})
    _, feedback = controller_at_hover(located(hover_of(scenario)), Instances())
    stiffness = -0.5 * feedback[1, COORDINATES.index("quaternion.x")]
    damping = -feedback[1, COORDINATES.index("angular_velocity.x")]
    found = crossover(scenario)
    assert 20.0 < found < 40.0
    assert abs((damping * 1j * found + stiffness) / (1j * found) ** 2) == pytest.approx(1.0, rel=2e-3)


def test_the_bandwidth_is_on_the_inertia_of_the_plant_and_not_on_how_slowly_a_redesign_is_sampled() -> None:
    scenario = Scenario(controller=LAW, plant=PLANT)
    at = crossover(scenario)
    assert crossover(scenario.with_changes(parameters={"plant.inertia.xx": 4.0})) < 0.6 * at
    assert crossover(scenario.with_changes(timing={"period": 0.05})) == at


LONG = """
name = "long"
[base.timing]
plant_interval = 0.01
[[controllers]]
name = "unified"
bandwidth = 10.0
[axis]
name = "flight"
sets = ["stop_time"]
values = [0.1, 50000.0]
[starts]
count = 1
position = 0.1
"""


def test_a_run_that_takes_longer_than_the_time_limit_is_a_failed_row_with_the_reason(
    tmp_path: Path, main: Main
) -> None:
    (tmp_path / "long.toml").write_text(LONG)
    file, out = tmp_path / "long.toml", tmp_path / "out"
    limited = ("compare", file, "--out", out, "--no-figures", "--native", "--engine", "compiled", "--time-limit")
    done = main(*limited, "1", code=1)
    assert "1 runs failed: runs.csv shows why" in done.stderr
    runs = pd.read_csv(tmp_path / "out" / "runs.csv")
    assert [*runs["status"]] == ["done", "failed"]
    assert runs["message"][1] == "it was ended: it takes more than the time limit of 1 s"
    done = main(*limited, "0", code=2)
    assert done.stderr == "quadcosim: --time-limit 0: expected a positive number of seconds\n"


TWO_AXES = (
    FILE.partition("[[conditions]]")[0].replace('name = "small"', 'name = "two"')
    + """
[[axes]]
name = "period"
sets = ["timing.period"]
values = [0.02, 0.1]
[[axes]]
name = "loss"
sets = ["timing.command_loss"]
values = [0.0, 0.3]
[starts]
count = 2
position = 1.0
"""
)


@pytest.mark.usefixtures("blank_figures")
def test_two_axes_make_cells_over_both_and_a_map_of_the_two_laws(
    tmp_path: Path, main: Main, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("two.toml").write_text(TWO_AXES)
    done = json.loads(main("compare", "two.toml", "--native", "--format", "png", "--json").stdout)
    assert done["axes"] == ["period", "loss"]
    cells = {(cell["controller"], *cell["values"].values()): cell for cell in done["cells"]}
    assert len(cells) == 8
    runs = pd.read_csv(Path("results/two/runs.csv"))
    assert [*runs][:6] == ["design_index", "vehicle", "condition", "controller", "period", "loss"]
    assert (runs["condition"] == runs["loss"].map("loss {:g}".format)).all()
    assert all("value" not in cell for cell in cells.values())
    assert {Path(file).name for file in done["files"] if file.endswith("png")} == {
        "limits.png", "map_survive_base_nominal.png", "map_settle_base_nominal.png",
    }  # fmt: skip
    loaded = load_comparison("two.toml")
    maps = comparison_report(loaded, Path("results/two/study.sqlite"), "", Wanted(most=0)).repeated
    assert maps is not None
    assert (maps.across, maps.up) == ("period", "loss")
    assert [one.title for one in maps.maps[:3]] == [
        "share surviving, coupled", "share surviving, uncoupled",
        "difference of the shares surviving, uncoupled minus coupled",
    ]  # fmt: skip
    for one in maps.maps[0].cells:
        share = cells["coupled", one.x / 1e3, one.y]
        assert (one.value, one.low, one.high) == tuple(share[f"survives.{end}"] for end in ("share", "low", "high"))
    Path("one.toml").write_text(TWO_AXES.replace("values = [0.0, 0.3]", "values = [0.3]").replace('"two"', '"one"'))
    again = json.loads(main("compare", "one.toml", "--native", "--no-figures", "--json").stdout)
    for cell in again["cells"]:  # the same runs as of a comparison without the other loss
        key = (cell["controller"], *cell["values"].values())
        ignored = {"cell": None}
        assert {**cell, **ignored} == {**cells[key], **ignored}


@pytest.mark.parametrize(
    ("form", "first", "fourth"),
    [
        (
            "markdown",
            "| controller | period [ms] | loss | survives | survives, minus coupled |",
            "| coupled | 20 | 0.3 | 1.00 [0.34, 1.00] |  |",
        ),
        ("latex", r"\begin{table*}  % needs \usepackage{booktabs}", r"\begin{tabular}{@{}lllllllll@{}}"),
        ("csv", "cell,vehicle,condition,controller,period,loss,count,", "2,base,loss 0,uncoupled,0.02,0.0,2,"),
    ],
)
def test_a_comparison_is_printed_as_a_table(
    form: str, first: str, fourth: str, folder: Path, main: Main, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(folder)
    Path("two.toml").write_text(TWO_AXES)
    lines = main("compare", "two.toml", "--native", "--table", form).stdout.splitlines()
    assert not [*Path("results").rglob("*.png")], "a table is printed without pictures"
    assert lines[0].startswith(first)
    assert lines[3].startswith(fourth)
    if form != "csv":
        assert "Shares of 2 initial conditions" in "".join(lines)
        assert "minus coupled: of pairs from the same one" in "".join(lines)
        assert " - (0) " in "".join(lines), "none of them settles"
        assert "of those alone that settle" in "".join(lines)
        return
    cells = pd.read_csv(StringIO("\n".join(lines))).set_index(["loss", "period", "controller"])
    has = cells["survives.difference"].notna()
    assert has.tolist() == cells.index.isin(["uncoupled"], level="controller").tolist()
    one, other = (cells.loc[(0.3, 0.02, law)] for law in ("uncoupled", "coupled"))
    assert one["settles.difference"] == one["settles.share"] - other["settles.share"]
    assert one["settles.difference.low"] <= one["settles.difference"] <= one["settles.difference.high"]


def test_an_unknown_table_or_a_third_axis_is_refused(folder: Path, main: Main) -> None:
    done = main("compare", folder / "small.toml", "--table", "html", code=2)
    assert done.stderr.endswith("--table html: expected csv, markdown or latex\n")
    (folder / "three.toml").write_text(TWO_AXES + '[axis]\nname = "timing.delay"\nvalues = [0.0]\n')
    assert "axis: expected [axis], or one or two [[axes]]" in main("compare", folder / "three.toml", code=2).stderr
