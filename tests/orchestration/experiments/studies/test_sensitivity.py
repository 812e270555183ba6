"""Sensitivity indices of functions whose indices are known, and of a study that was run."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from orchestration.experiments.studies import sensitivity
from orchestration.experiments.studies.axes import Axis
from orchestration.experiments.studies.drawing import draw_study, indices_of, numbers
from orchestration.experiments.studies.sensitivity import Index, SensitivityMethod, analyse, shares
from orchestration.experiments.studies.study import Study
from orchestration.foundation.basics.simulator import Floats
from orchestration.simulation.figures.style import SCREEN
from quadcosim import UsageError
from tests.orchestration.experiments.studies.common import axis, short, study, swept

AXES = ["a", "b", "c"]


def indices(method: SensitivityMethod, values: Floats, design: Floats) -> dict[tuple[str, str], Index]:
    return {(index.kind, index.axis): index for index in analyse(method, AXES, design, values, "metric")}


def ishigami(design: Floats) -> Floats:
    """sin a + 7 sin² b + 0.1 c⁴ sin a over [-π, π]³, the usual test case with exact Sobol indices."""
    a, b, c = (2.0 * design.T - 1.0) * math.pi
    values: Floats = np.sin(a) + 7.0 * np.sin(b) ** 2 + 0.1 * c**4 * np.sin(a)
    return values


def test_sobol_indices_of_ishigamis_function_are_the_exact_ones() -> None:
    design = shares("saltelli", 3, 2048, seed=0)
    found = indices("saltelli", ishigami(design), design)
    exact = {"first": (0.3139, 0.4424, 0.0), "total": (0.5576, 0.4424, 0.2437)}
    for kind, values in exact.items():
        for name, value in zip(AXES, values, strict=True):
            index = found[kind, name]
            assert index.value == pytest.approx(value, abs=0.02)
            assert 0.0 < index.confidence < 0.1


def test_sobol_indices_of_a_sum_are_the_shares_of_its_variance() -> None:
    design = shares("saltelli", 3, 512, seed=1)
    found = indices("saltelli", design @ np.array([3.0, 1.0, 0.0]), design)
    for kind in ("first", "total"):
        assert [found[kind, name].value for name in AXES] == pytest.approx([0.9, 0.1, 0.0], abs=0.01)


def test_morris_effects_of_a_linear_function_are_its_slopes_without_spread() -> None:
    design = shares("morris", 3, 10, seed=2)
    found = indices("morris", design @ np.array([3.0, -1.0, 0.0]), design)
    assert [found["mu_star", name].value for name in AXES] == pytest.approx([3.0, 1.0, 0.0], abs=1e-12)
    assert [found["sigma", name].value for name in AXES] == pytest.approx([0.0, 0.0, 0.0], abs=1e-12)


def test_morris_spread_shows_an_interaction() -> None:
    design = shares("morris", 3, 20, seed=3)
    found = indices("morris", design[:, 0] * design[:, 1] + design[:, 2], design)
    assert min(found["sigma", "a"].value, found["sigma", "b"].value) > 0.1
    assert found["sigma", "c"].value == pytest.approx(0.0, abs=1e-12)


def test_the_interval_of_a_morris_spread_is_as_wide_as_it_varies_from_design_to_design() -> None:
    found = []
    for seed in range(40):
        design = shares("morris", 3, 20, seed=seed)
        found.append(indices("morris", design[:, 0] * design[:, 1] + design[:, 2], design)["sigma", "a"])
    sigmas = [each.value for each in found]
    assert np.mean([each.confidence for each in found]) == pytest.approx(1.96 * np.std(sigmas, ddof=1), rel=0.3)
    with pytest.raises(UsageError, match=r"design\.samples = 1: expected at least 2 for morris"):
        shares("morris", 3, 1, seed=0)


@pytest.mark.parametrize("method", sensitivity.METHODS)
def test_the_same_values_give_the_same_indices(method: SensitivityMethod) -> None:
    design = shares(method, 3, 8, seed=4)
    one, two = (indices(method, ishigami(design), design) for _ in range(2))
    assert {name: index.value for name, index in one.items()} == {name: index.value for name, index in two.items()}


@pytest.mark.parametrize("method", sensitivity.METHODS)
@pytest.mark.parametrize("hole", [math.nan, math.inf])
def test_missing_values_are_refused_with_their_number(method: SensitivityMethod, hole: float) -> None:
    design = shares(method, 3, 8, seed=5)
    values = ishigami(design)
    values[[1, 4]] = hole
    with pytest.raises(UsageError, match=rf"metric: 2 of {len(values)} runs have no value, expected one for each"):
        indices(method, values, design)


# -- of studies -------------------------------------------------------------------------------------------

MASS = Axis(name="mass", targets=("plant.mass",), low=0.8, high=1.2)
DELAY = Axis(name="delay", targets=("timing.delay",), low=0.0, high=0.02)


def screening(*axes: Axis, method: str = "morris") -> Study:
    return study(*axes, base=short(), method=method, samples=4)


@pytest.fixture(scope="module")
def flown(tmp_path_factory: pytest.TempPathFactory) -> tuple[Study, Path]:
    """A tiny Morris study, flown, and its folder."""
    folder = tmp_path_factory.mktemp("morris")
    chosen = screening(MASS, DELAY)
    swept(chosen, folder)
    return chosen, folder


def test_a_finished_screening_gives_a_table_and_a_figure(flown: tuple[Study, Path]) -> None:
    chosen, folder = flown
    assert len(chosen.points) == 4 * 3
    table, figure, _ = draw_study(chosen, folder, "position_rmse")
    assert (table.name, figure.name) == ("sensitivity_position_rmse.csv", "sensitivity_position_rmse.png")
    read = pd.read_csv(table)
    assert list(read.columns) == ["axis", "kind", "value", "confidence"]
    assert [tuple(pair) for pair in read[["kind", "axis"]].to_numpy()] == [
        ("mu_star", "mass"), ("mu_star", "delay"), ("sigma", "mass"), ("sigma", "delay")
    ]  # fmt: skip
    assert (read["value"][:2] > 0.0).all()
    assert figure.read_bytes().startswith(b"\x89PNG")
    metrics = ("control_effort.torque", "control_effort.thrust")
    named = [draw_study(chosen, folder, metric, replace(SCREEN, formats=("png",)))[0].name for metric in metrics]
    assert named == [f"sensitivity_{metric}.csv" for metric in metrics]


def test_the_indices_belong_to_the_design_that_was_run(flown: tuple[Study, Path]) -> None:
    chosen, _ = flown
    values = np.array([point["mass"] for point in chosen.points], dtype=float)
    found = {(index.kind, index.axis): index.value for index in indices_of(chosen, values, "mass itself")}
    assert found["mu_star", "mass"] == pytest.approx(0.4)
    assert found["mu_star", "delay"] == pytest.approx(0.0, abs=1e-12)


def test_an_unfinished_study_has_no_indices() -> None:
    with pytest.raises(UsageError, match="study: 5 of 12 runs are there, expected all"):
        indices_of(screening(MASS, DELAY), np.ones(5), "metric")


def test_listed_axes_have_no_indices() -> None:
    with pytest.raises(UsageError, match="expected every axis to be a range"):
        indices_of(screening(MASS, axis("seed", 1, 2)), np.ones(12), "metric")


def test_a_design_for_another_purpose_has_no_indices() -> None:
    with pytest.raises(UsageError, match=r"design.method = random, expected morris or saltelli"):
        indices_of(screening(MASS, DELAY, method="random"), np.ones(4), "metric")


def test_a_metric_that_some_runs_do_not_have_is_refused(flown: tuple[Study, Path]) -> None:
    chosen, folder = flown
    with pytest.raises(UsageError, match="divergence_time: 12 of 12 runs have no value"):
        draw_study(chosen, folder, "divergence_time")


def test_an_outcome_that_does_not_vary_has_no_index(flown: tuple[Study, Path]) -> None:
    chosen, folder = flown
    with pytest.raises(UsageError, match="outcome does not vary over the 12 runs: it has no index"):
        draw_study(chosen, folder, "outcome")  # in this short a flight none has settled


def test_the_outcome_is_one_for_a_good_run_and_missing_for_one_that_failed() -> None:
    runs = pd.DataFrame({"outcome": ["settled", "bounded", "diverged", None], "good": [1.0, 0.0, 0.0, None]})
    assert numbers(runs, "outcome").tolist() == pytest.approx([1.0, 0.0, 0.0, math.nan], nan_ok=True)
