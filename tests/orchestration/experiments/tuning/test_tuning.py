import itertools
import math
import re
import sqlite3
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import pytest

from orchestration.experiments.tuning import tune as tunes
from orchestration.experiments.tuning.tune import run_searches, write
from orchestration.experiments.tuning.tuning import Tuning, TuningResult, search
from orchestration.experiments.tuning.tuning_file import load_tuning
from orchestration.experiments.tuning.tuning_problem import COST, best_by_period, minimise
from orchestration.foundation.basics.documents import read_toml
from orchestration.foundation.basics.errors import QuadcosimError, UsageError
from orchestration.simulation.engines.batch import shape
from orchestration.systems.system.paths import value_at
from tests.orchestration.components.fmi.small import needs_compiler

FILE = Path(__file__).with_name("test_tuning.toml").read_text(encoding="utf-8")
GAINS = "components.controller.parameters.gain"


def loaded(path) -> Tuning:
    found = load_tuning(path)
    assert isinstance(found, Tuning)
    return found


@pytest.fixture
def tuning(tmp_path) -> Tuning:
    (tmp_path / "bowl.toml").write_text(FILE)
    return loaded(tmp_path / "bowl.toml")


def bowl(systems):
    """Metrics as of flights whose cost is lowest at an attitude gain of 10 and a surface gain of 5."""
    metrics = []
    for system in systems:
        attitude, surface = (value_at(system, f"{GAINS}.{name}") for name in ("attitude", "surface"))
        cost = 1.0 + math.log(attitude / 10.0) ** 2 + (surface - 5.0) ** 2
        metrics.append({COST: cost, "good": cost < 50.0, "diverged": cost > 60.0})
    return metrics


def test_a_search_finds_the_bottom_of_a_bowl(tuning):
    found = search(tuning, 0.01, 1, bowl, bowl, lambda share: None)
    assert found.values["controller.gain.attitude"] == pytest.approx(10.0, rel=0.02)
    assert found.values["controller.gain.surface"] == pytest.approx(5.0, rel=0.02)
    assert found.values["controller.gain.theta"] == found.values["controller.gain.attitude"]
    assert found.cost == pytest.approx(1.0, abs=1e-3)
    assert found.evaluations == tuning.budget


def test_a_search_says_by_how_much_its_end_still_lowered_the_cost(tuning):
    two = replace(tuning, evaluations=9)  # three generations of six, for two parameters
    assert two.budget == 18
    costs = iter([[8.0] * 6, [4.0] * 6, [3.0] * 6])
    assert minimise(two, 1, lambda points: next(costs)[: len(points)], lambda share: None).lowered == 0.25
    found = search(two, 0.01, 1, bowl, bowl, lambda share: None)
    assert replace(found, lowered=0.25).convergence == (
        "the last third of 18 evaluations lowered it by 25 %: more may lower it further"
    )
    assert replace(found, lowered=0.0004).convergence.endswith("lowered it by 0.04 %")
    assert (
        replace(found, lowered=0.0).convergence
        == "the last third of 18 evaluations found no lower one, though there may be one near by"
    )


def test_searches_are_reproducible_and_depend_on_the_seed(tuning):
    short = replace(tuning, evaluations=40)
    one, again, other = (search(short, 0.01, seed, bowl, bowl, lambda share: None) for seed in (1, 1, 2))
    assert one == again
    assert one.values != other.values


def run(cost, *, good=True, diverged=False):
    return {COST: cost, "good": good, "diverged": diverged}


def test_a_run_that_diverges_has_the_stated_cost_which_also_bounds_that_of_others(tuning):
    assert tuning.mean_cost([run(1.0), run(2.0, good=False)]) == pytest.approx(1.5)
    assert tuning.mean_cost([run(1.0), run(1.0, good=False, diverged=True)]) == pytest.approx(5.5)
    assert tuning.mean_cost([run(1.0), run(None), run(99.0)]) == pytest.approx(7.0)


def test_survival_is_judged_apart_from_the_cost_of_those_that_survive(tuning):
    def judge(systems):
        return [run(1.0), run(2.0, good=False), run(3.0), run(0.5, good=False, diverged=True)]

    found = search(tuning, 0.01, 1, bowl, judge, lambda share: None)
    assert (found.judged, found.survives, found.good) == (4, 3, 2)
    assert found.survivors_cost == pytest.approx(2.0)
    assert found.judgement.startswith("3 of 4 other starts survive (a share of 0.301 to 0.954, Wilson, 95 %)")
    assert found.judgement.endswith("at a mean cost of 2, 2 are good")


def test_where_none_survives_there_is_no_cost(tuning):
    found = search(tuning, 0.01, 1, bowl, lambda systems: [run(1.0, diverged=True)] * 4, lambda share: None)
    assert (found.survives, found.survivors_cost) == (0, None)
    assert "mean cost" not in found.judgement


def test_no_initial_condition_is_both_tuned_on_and_judged_on(tuning):
    seen = []

    def run(systems):
        seen.append(
            [tuple(value_at(s, f"components.plant.parameters.initial.velocity.{a}") for a in "xyz") for s in systems]
        )
        return bowl(systems)

    search(tuning, 0.01, 1, run, run, lambda share: None)
    trained, judged = set(itertools.chain(*seen[:-1])), set(seen[-1])
    assert len(trained) == 3
    assert len(judged) == 4
    assert not trained & judged


def test_every_start_has_its_own_seed_as_in_a_comparison(tuning):
    values = tuning.values([0.5, 0.5])
    ensembles = tuning.starts, tuning.judging_ensemble()
    seeds = [system.seed for starts in ensembles for system in tuning.systems(0.01, values, starts)]
    assert seeds == [tuning.base.seed + start for start in range(7)]


def test_runs_have_the_period_that_is_tuned_for(tuning):
    systems = tuning.systems(0.02, tuning.values([0.5, 0.5]), tuning.starts)
    assert {system.components["controller"].sampling.period for system in systems} == {0.02}
    own, _ = replace(tuning, periods=None).first_run()
    assert own.components["controller"].sampling == tuning.origin.components["controller"].sampling


def test_the_best_search_is_the_one_of_lowest_cost(tuning):
    one = search(tuning, 0.01, 1, bowl, bowl, lambda share: None)
    worse = replace(one, seed=2, cost=one.cost + 1.0, survivors_cost=0.0)
    assert list(best_by_period([worse, one])) == [one]


def test_an_interrupted_tuning_continues(tuning, tmp_path):
    tuning = replace(tuning, evaluations=20)
    files, count = tuning.files(), 0
    lines: list[str] = []

    def run(systems):
        nonlocal count
        count += len(systems)
        if count > 200:
            raise KeyboardInterrupt
        return bowl(systems)

    def results_of(run):
        def find(period, seed, report, keeping):
            return search(tuning, period, seed, run, run, report, keeping)

        return run_searches(
            tuning, files, tmp_path / "kept", find, TuningResult,
            engine="", progress=lambda share: None, announce=lines.append,
        )  # fmt: skip

    with pytest.raises(KeyboardInterrupt):
        results_of(run)
    before = list(lines)
    assert 0 < len(before) < 4
    done = results_of(bowl)
    written = list(write(tuning, done, tmp_path / "gains", "quadcosim tune"))
    assert len(lines) == 4
    assert [path.name for path in written] == ["bowl_10ms.toml", "bowl_20ms.toml"]

    def fail(systems):
        pytest.fail("run again")

    assert results_of(fail) == done
    gains = read_toml(written[0], "gains")["controller"]
    assert set(gains) == {"gain.attitude", "gain.theta", "gain.surface"}
    comments = written[0].read_text()
    assert re.search(r"# Of 2 searches that of seed [12] is taken", comments)
    assert comments.count("other starts survive (a share of ") == 2
    assert re.search(r"# The loop is sampled every 10 ms; .*\. By quadcosim \S+, sources [0-9a-f]{16}, numpy", comments)


@pytest.mark.parametrize(
    ("before", "after", "named"),
    [
        ('bad = 10.0', 'bad = 10.0\nworse = 1', "cost.worse: no such key; expected one of of, by, bad"),
        ("bad = 10.0", "", "cost.bad: expected a value"),
        ("stop = 20.0", "", "axis surface: expected values, or start and stop, with number or to be sampled"),
        ("start = 0.5\nstop = 20.0", "values = [1.0]", "parameters surface: expected start and stop, and what it sets"),
        ("seeds = [1, 2]", "seeds = []", "seeds: expected at least one"),
        ("evaluations = 100", "evaluations = 0", "evaluations = 0: expected at least 1"),
        ("controller.gain.surface", "controler.gain.surface", "controler.gain.surface: expected controller.NAME"),
        ("count = 3", "count = 0", "starts.count = 0: expected a whole number from 1"),
    ],
)  # fmt: skip
def test_errors_in_a_file_are_reported(tmp_path, before, after, named):
    path = tmp_path / "bowl.toml"
    path.write_text(FILE.replace(before, after))
    with pytest.raises(UsageError) as error:
        load_tuning(path)
    assert str(error.value).startswith(f"{path}: {named}")


def test_a_single_parameter_is_tuned_and_none_is_refused(tuning):
    one = replace(tuning, parameters=tuning.parameters[:1], evaluations=60)
    found = minimise(one, 0, lambda points: [abs(float(point[0]) - 0.3) for point in points], lambda share: None)
    assert found.shares == pytest.approx([0.3], abs=0.01)
    assert found.evaluations == one.budget == 60, "ten generations"
    assert replace(one, evaluations=61).effort == (
        "4 searches of 66 evaluations of the cost each: 61 a parameter are 61, rounded up to whole generations of 6"
    )
    with pytest.raises(UsageError, match="expected at least one"):
        replace(tuning, parameters=())


LOW = '"trajectory.start_z" = -10.0'


@pytest.mark.parametrize(
    "text",
    [
        FILE.replace("[base.plant]", f"{LOW}\n[base.plant]"),
        FILE.replace("[base]", "[base]\nvehicle = 'low_flier.toml'"),
    ],
    ids=["its own", "that of its vehicle"],
)
def test_initial_conditions_lie_around_the_trajectory_of_the_base(text, tmp_path):
    (tmp_path / "low_flier.toml").write_text(f"[controller]\n{LOW}\n")
    (tmp_path / "low.toml").write_text(text)
    low = loaded(tmp_path / "low.toml")
    for starts in (low.starts, low.judging_ensemble()):
        systems = low.systems(0.01, low.values([0.5, 0.5]), starts)
        heights = [value_at(system, "components.plant.parameters.initial.position.z") for system in systems]
        assert len(heights) == starts.count
        assert all(abs(height + 10.0) <= 1.0 for height in heights)


def test_initial_conditions_that_are_judged_on_follow_the_others(tuning):
    assert tuning.judging_ensemble() == replace(tuning.starts, first=3, count=4)


def searched(tuning, folder, run, judge=bowl):
    return run_searches(
        tuning, tuning.files(), folder,
        lambda period, seed, report, keeping: search(tuning, period, seed, run, judge, report, keeping),
        TuningResult, engine="", progress=lambda share: None, announce=lambda line: None,
    )  # fmt: skip


def test_a_search_stopped_at_any_generation_loses_it_alone_and_ends_with_the_same_bits(tuning, tmp_path):
    tuning = replace(tuning, periods=(0.01,), seeds=(1,), evaluations=15)
    generations: list[int] = []

    def counted(systems):
        generations.append(len(systems))
        return bowl(systems)

    whole = searched(tuning, tmp_path / "whole", counted)
    assert len(generations) >= 4

    def stopping(systems):
        if not evaluated_before_stop:
            raise KeyboardInterrupt
        evaluated_before_stop.pop()
        return bowl(systems)

    for _ in generations:  # each start evaluates one generation more
        evaluated_before_stop = [None]
        with pytest.raises(KeyboardInterrupt):
            searched(tuning, tmp_path / "stopped", stopping, judge=stopping)
    assert searched(tuning, tmp_path / "stopped", stopping) == whole


@pytest.mark.parametrize("damage", ["truncated", "other bytes", "a changed cost", "an older record", "a missing table"])
def test_a_damaged_record_is_one_line_that_says_what_to_do(damage, tuning, tmp_path):
    tuning = replace(tuning, periods=(0.01,), seeds=(1,), evaluations=15)
    searched(tuning, tmp_path, bowl)
    (record,) = tmp_path.glob("*.sqlite")
    content = record.read_bytes()
    if damage == "truncated":
        record.write_bytes(content[: len(content) // 2])
    elif damage == "other bytes":
        record.write_bytes(content[:5000] + b"x" * 3000 + content[8000:])
    elif damage == "an older record":
        record.write_text("[]")
    else:
        with closing(sqlite3.connect(record)) as connection, connection:
            connection.execute("UPDATE points SET cost = 0.0" if damage == "a changed cost" else "DROP TABLE points")
    with pytest.raises(QuadcosimError, match=r"(put back a copy|take another folder), or remove it") as caught:
        searched(tuning, tmp_path, bowl)
    assert str(caught.value).startswith(f"{record}: ")
    assert len(str(caught.value).splitlines()) == 1


@needs_compiler
def test_a_tuning_is_not_continued_by_another_engine_when_lanes_fail(tuning, tmp_path, monkeypatch):
    tuning = replace(tuning, periods=(0.02,), seeds=(1,), evaluations=3)
    told: list[str] = []
    monkeypatch.setattr(tunes, "search", lambda t, p, s, run, judge, *rest: search(t, p, s, bowl, bowl, *rest))

    def tuned(folder):
        return tunes.tune(tuning, out=folder / "gains", folder=folder, progress=None, announce=told.append).searches

    def no_compiler():
        raise QuadcosimError("no compiler")

    tuned(tmp_path / "lanes")
    with monkeypatch.context() as broken:
        broken.setattr(shape, "preferred_lanes", no_compiler)
        with pytest.raises(
            QuadcosimError,
            match=r"lanes/\w{16}\.sqlite: expected engine batch, as of the runs there \(no compiler\); engine compiled "
            r"begins another record$",
        ):
            tuned(tmp_path / "lanes")
        tuned(tmp_path / "alone")
    told.clear()
    tuned(tmp_path / "alone")
    assert told[:2] == [
        "1 search of 6 evaluations of the cost each",
        "engine compiled: native FMUs, one run at a time (as the runs there)",
    ]
    assert not any(line.startswith("period") for line in told), "expected no search again"
