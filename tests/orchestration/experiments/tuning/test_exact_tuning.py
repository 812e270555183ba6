"""Tuning by exact expectations: against a separate search with matrices written by hand, and refusals."""

import math
import re
from dataclasses import replace
from pathlib import Path

import pytest

from orchestration.components.building import fmus
from orchestration.experiments.studies.axes import Axis
from orchestration.experiments.tuning import exact
from orchestration.experiments.tuning.exact import ExactTuning, ExactTuningResult, search_exactly
from orchestration.experiments.tuning.tune import Tuned, tune
from orchestration.experiments.tuning.tuning_file import load_tuning
from orchestration.experiments.tuning.tuning_problem import COST
from orchestration.foundation.basics.documents import read_toml
from orchestration.foundation.basics.errors import UsageError
from orchestration.systems.system.component import Sampling
from orchestration.systems.system.model import System
from orchestration.theory.exact.expect import Expected
from orchestration.theory.exact.loops import Loops
from orchestration.theory.stability.operating_point import NotAnEquilibriumError
from tests.extent import in_test_all
from tests.orchestration.theory.exact.common import servo
from tests.places import EXAMPLES

FILE = EXAMPLES / "distributed_servo" / "tuning.toml"
GAINS = "components.controller.parameters"
EXPECTED = Expected(
    objectives={}, reasons={}, mean_square_radius=0.5, fourth_moment_radius=None, accuracy=0.0, method="", period=0.006
)


def tuning(**changes: object) -> ExactTuning:
    loaded = load_tuning(FILE)
    assert isinstance(loaded, ExactTuning)
    return replace(loaded, **{"base": fmus.native_twins(loaded.base), **changes})  # type: ignore[arg-type]


def tuned(problem: ExactTuning, folder: Path) -> Tuned:
    return tune(problem, out=folder / "gains", folder=folder / "kept", progress=None, announce=None)


def cost(K: float, Td: float) -> float:
    loop = servo(K=K, Td=Td, delay=0.003)
    return float(loop.costs()[0]) / 0.006 if loop.radius < 1.0 else math.inf


def test_the_tuned_gains_have_the_lowest_cost_by_matrices_and_another_search(tmp_path: Path) -> None:
    from scipy.optimize import minimize

    found = tuned(tuning(evaluations=30), tmp_path)
    (one,) = found.searches
    K, Td = (one.values[f"{GAINS}.{name}"] for name in ("K", "Td"))
    least = minimize(lambda x: cost(*x), (1.5, 0.035), method="Nelder-Mead", options={"xatol": 1e-4, "fatol": 1e-7})
    assert one.cost == pytest.approx(cost(K, Td), rel=1e-9)
    assert one.cost == pytest.approx(least.fun, rel=1e-3)
    assert one.cost >= least.fun * (1.0 - 1e-6)
    (path,) = found.written
    gains = read_toml(path, "gains")["components"]["controller"]["parameters"]
    assert gains == {"K": pytest.approx(K, rel=1e-5), "Td": pytest.approx(Td, rel=1e-5)}
    assert "evaluations of the exact expectation of (J)." in path.read_text()
    assert tuned(tuning(evaluations=30), tmp_path).searches == found.searches


@in_test_all
def test_a_search_that_starts_where_no_cost_is_finite_reduces_the_radius() -> None:
    wide = (
        Axis(name="K", targets=(f"{GAINS}.K",), low=2.0, high=40.0),
        Axis(name="Td", targets=(f"{GAINS}.Td",), low=0.02, high=0.3),
    )
    short, longer = (search_exactly(tuning(parameters=wide, evaluations=n), 0.006, 1, lambda _: None) for n in (1, 15))
    assert isinstance(short, ExactTuningResult)
    assert short.cost == math.inf
    assert longer.mean_square_radius < short.mean_square_radius


def test_a_cost_without_an_expectation_is_refused_by_its_reason() -> None:
    with pytest.raises(UsageError, match=r"expected mean\(…\) or rms\(…\)"):
        search_exactly(tuning(cost="J + max(servo.angle)"), 0.006, 1, lambda _: None)


def test_a_candidate_without_a_rest_is_passed_over_and_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    least = 0.0

    def restless(system: System, loops: Loops, flown: bool) -> Expected:
        if (K := system.components["controller"].parameters["K"]) > least:
            raise NotAnEquilibriumError("the operating point is not at rest")
        return replace(EXPECTED, objectives={COST: -K})

    monkeypatch.setattr(exact, "expected_of", restless)
    refusal = r"none of the first 6 candidates has an expectation, the first, K = [.\d]+, Td = [.\d]+: the operating "
    with pytest.raises(UsageError, match=refusal):
        tuned(tuning(evaluations=3), tmp_path)
    least, told = 1.5, list[str]()
    wide = replace(tuning(evaluations=9), name="wide")
    (one,) = tune(wide, out=tmp_path, folder=tmp_path, progress=None, announce=told.append).searches
    assert one.cost == -one.values[f"{GAINS}.K"] >= -least
    assert re.fullmatch(r"\d+ of 18 candidates had no expectation, the first, K = .*: the operating .* rest", told[-1])


def test_a_cost_is_that_of_what_runs_print_if_so_requested(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def known(system: System, loops: Loops, flown: bool) -> Expected:
        doubt = "a run diverges" if flown else ""
        return replace(EXPECTED, objectives={COST: 1.0 if loops.simulated else 2.0}, doubt=doubt)

    monkeypatch.setattr(exact, "expected_of", known)
    found = tune(tuning(evaluations=3), out=tmp_path, folder=tmp_path, as_simulated=True, progress=None, announce=None)
    assert found.searches[0].cost == 1.0
    assert "evaluations of the exact expectation, as simulated, of (J)." in found.written[0].read_text()
    assert "the mean-square radius is 0.5; warning: a run diverges." in found.written[0].read_text()
    assert found.verdict.endswith("; warning: a run diverges")  # a run of the tuned ones only
    assert tuned(tuning(evaluations=3), tmp_path).searches[0].cost == 2.0


def test_a_search_begins_with_the_values_of_the_file_and_says_what_they_cost(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def narrow(system: System, loops: Loops, flown: bool) -> Expected:
        """The least cost at the gains of the file, between which and all others it is higher."""
        K, Td = (float(system.components["controller"].parameters[name]) for name in ("K", "Td"))
        return replace(EXPECTED, objectives={COST: 2.0 if math.hypot(K - 1.5, Td - 0.035) < 1e-9 else 3.0 + K})

    monkeypatch.setattr(exact, "expected_of", narrow)
    kept = tuned(tuning(evaluations=3), tmp_path)
    (one,) = kept.searches
    assert one.values == {f"{GAINS}.K": pytest.approx(1.5), f"{GAINS}.Td": pytest.approx(0.035)}
    none_less = "6 ms cost 2, that of the file's own values: none costs less; a single generation of 6 evaluations: no "
    assert f"{none_less}search yet; the mean-" in kept.verdict

    off, Td = Axis(name="K", targets=(f"{GAINS}.K",), low=2.0, high=3.0), tuning().parameters[1]
    other = tuned(tuning(parameters=(off, Td), evaluations=40, name="off"), tmp_path)
    assert "6 ms cost 5, 2.5 times 2 with the file's own values; the last third of 84 evaluations" in other.verdict
    assert "; K = 2 lies on the lower bound of its range: widen it; the file's own K = 1.5" in other.verdict
    assert "widen it; the file's own K = 1.5 lies outside of its range; the mean-" in other.verdict
    text = other.written[0].read_text()
    assert "of least cost 5, 2.5 times 2 with the file's own values.\n# K = 2 lies on the lower bound" in text

    several = tuning(
        parameters=(replace(tuning().parameters[0], targets=(f"{GAINS}.K", f"{GAINS}.Td")),), name="several"
    )
    found = tuned(replace(several, evaluations=6), tmp_path)
    assert found.searches[0].own_cost is None
    assert "the file has no single number for K, so its own values are not compared" in found.verdict


def test_the_cost_may_be_an_objective_of_any_name() -> None:
    base = fmus.native_twins(load_tuning(FILE).origin)
    named = replace(base, objectives={**base.objectives, "cost": "2 * J"})
    assert tuning(base=named, cost="cost").system(0.006, {}).objectives[COST] == "cost"
    with pytest.raises(UsageError, match=r"^cost\.of: there is no objective costs; .*cost\? expected one of J, cost$"):
        tuning(base=named, cost="2 * costs")


@pytest.mark.parametrize(
    ("before", "after", "named"),
    [
        ('by = "expect"', 'by = "expect"\nbad = 1.0', 'cost.bad: expected none with cost.by = "expect"'),
        ("[search]", "[starts]\ncount = 3\n[search]", 'starts: expected none with cost.by = "expect"'),
        (
            'by = "expect"',
            'by = "runs"',
            'base: expected a scenario of the quadrotor, whose initial conditions are known, or cost.by = "expect" for '
            "another system; runs of any system, and costs of them, are for quadcosim sweep",
        ),
        (
            "scenario = ",
            "base.system = ",
            "base.system: expected the path of a file in place of [base], as scenario = ",
        ),
        ('by = "expect"', 'by = "guess"', "cost.by = 'guess': expected 'runs' or 'expect'"),
        ("parameters.K", "parameter.K", "components.controller.parameter.K: "),
    ],
)
def test_errors_in_a_file_are_reported(before: str, after: str, named: str, tmp_path: Path) -> None:
    path = tmp_path / "servo.toml"
    system = (FILE.parent / "system.toml").as_posix()
    path.write_text(FILE.read_text().replace('system.toml"', f'{system}"').replace(before, after))
    with pytest.raises(UsageError) as error:
        load_tuning(path)
    assert str(error.value).startswith(f"{path}: {named}")


def test_engine_and_workers_are_refused_where_there_are_no_runs(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="expected none; a tuning by expect makes no runs"):
        tune(tuning(), out=tmp_path, engine="batch")


def test_several_sampled_components_are_tuned_at_their_own_periods_and_no_others(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    base, seen = fmus.native_twins(load_tuning(FILE).origin), set[tuple[float, ...]]()
    controller = base.components["controller"]
    twice = replace(base, components={**base.components, "other": replace(controller, sampling=Sampling(period=0.03))})
    with pytest.raises(UsageError, match=r"search\.periods: expected a .*; leave out search\.periods to keep the p"):
        tuning(base=twice)

    def known(system: System, loops: Loops, flown: bool) -> Expected:
        periods = (one.sampling.period for one in system.components.values() if isinstance(one.sampling, Sampling))
        seen.add(tuple(periods))
        return replace(EXPECTED, objectives={COST: float(system.components["controller"].parameters["K"])})

    monkeypatch.setattr(exact, "expected_of", known)
    own = tuning(base=twice, periods=None, evaluations=3)
    found = tuned(own, tmp_path)
    assert seen == {(0.006, 0.03)}
    assert found.written == (tmp_path / "gains" / "servo_gains_own_periods.toml",)
    text = found.written[0].read_text()
    assert text.startswith("# Tuned for the periods of the file by: quadcosim.tune\n")
    assert "The loop is sampled controller every 6 ms, other every 30 ms;" in text
    assert found.verdict.startswith("best of 1 searches: own periods cost ")
    assert tuned(own, tmp_path).searches == found.searches
