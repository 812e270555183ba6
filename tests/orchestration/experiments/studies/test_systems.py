"""Studies and limits of a system that is no quadrotor: a double integrator under state feedback, with known answers."""

import dataclasses
import itertools
import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from orchestration.components.fmi.reuse import Instances
from orchestration.experiments.limits.limit import limit
from orchestration.experiments.studies.axes import Axis
from orchestration.experiments.studies.drawing import draw_study
from orchestration.experiments.studies.store import open_for_reading, store_path
from orchestration.experiments.studies.store_columns import expect_columns, is_column
from orchestration.experiments.studies.study import Study
from orchestration.experiments.studies.study_file import load_study
from orchestration.experiments.studies.table import frame
from orchestration.quadrotor.flight.hover_loop import HoverLoop
from orchestration.simulation.requests.request import load_request
from orchestration.systems.system.model import Criterion, System
from orchestration.systems.system.paths import changed
from orchestration.theory.stability.perturbed_runs import growth_of
from quadcosim import Scenario, Timing, UsageError, run
from tests.commands import Main
from tests.orchestration.experiments.studies.common import bits, error_line, one_line, sweep
from tests.places import EXAMPLES

FILE = EXAMPLES / "double_integrator" / "system.toml"
PERIOD, DELAY = "components.controller.sampling.period", "connections.command.delay"
K_D = "components.controller.parameters.k_d"
AT_REST = {"components.plant.parameters.initial.x": 0.0, "components.plant.parameters.initial.v": 0.0}


@pytest.fixture(scope="module")
def system() -> System:
    found = load_request(FILE)
    assert isinstance(found, System)
    return dataclasses.replace(
        found,
        stop_time=20.0,
        objectives={"late": "max(abs(plant.x) * (time > stop_time / 2))", "peak": "max(abs(plant.v))"},
        criterion=Criterion(good="late < 0.9", diverged="abs(plant.x) > 1e3"),
        operating_point=AT_REST,
    )


def axis(path: str, *values: Any) -> Axis:
    return Axis(name=path, targets=(path,), values=values)


# -- sweeps -----------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def swept(system: System, tmp_path_factory: pytest.TempPathFactory) -> tuple[Study, Path]:
    """Periods below and above the largest that is stable, 2 s and 1.43 s, by gains of the velocity."""
    folder = tmp_path_factory.mktemp("swept")
    chosen = Study(name="study", base=system, axes=(axis(PERIOD, 0.5, 1.5, 4.0), axis(K_D, 1.0, 1.4)))
    assert sweep(chosen, out=folder).failed == 0
    return chosen, folder


def test_rows_of_a_system_have_its_objectives_and_its_outcomes(swept: tuple[Study, Path]) -> None:
    chosen, folder = swept
    table = frame(store_path("study", folder))
    assert table["outcome"].tolist() == ["good", "good", "good", "bad", "diverged", "diverged"]
    assert table["good"].fillna(False).tolist() == [True, True, True, False, False, False]
    direct = run(chosen.system(1, {})).metrics
    assert [table.loc[1, name] for name in ("late", "peak")] == [direct["late"], direct["peak"]]
    assert {"guid.plant", "guid.controller", "horizon", "steps"} <= set(table.columns)


def test_a_study_of_a_system_is_not_run_again_unless_an_objective_changes(swept: tuple[Study, Path]) -> None:
    chosen, folder = swept
    assert sweep(chosen, out=folder).flown == 0
    other = dataclasses.replace(chosen.origin, objectives={**chosen.origin.objectives, "late": "max(plant.x)"})
    with pytest.raises(UsageError, match=r"holds another study \(objectives.late was .*, is \"max\(plant.x\)\"\)"):
        sweep(dataclasses.replace(chosen, base=other), out=folder)


def test_the_figure_of_a_system_is_of_its_first_objective_that_varies(swept: tuple[Study, Path]) -> None:
    chosen, folder = swept
    assert [path.name for path in draw_study(chosen, folder)] == [
        "late.png", "late.svg", "late_map.png", "late_map.svg",
    ]  # fmt: skip
    with pytest.raises(UsageError, match="metric ultimate_bound: expected one of good, horizon, late, peak, "):
        draw_study(chosen, folder, "ultimate_bound")


def test_an_axis_multiplies_what_the_law_of_the_run_has_also_by_its_label() -> None:
    """Not what that of the base has: a factor of 1 would be another gain."""
    laws = {"UnifiedController": 15.0, "GeometricController": 104.26}
    gain = {"name": "gain", "multiplies": ["controller.gain.attitude"], "values": [1.0, 2.0]}
    controllers = {"name": "controller", "values": [*laws]}
    labelled = {**controllers, "labels": ["sliding", "geometric"]}
    for native, axes in itertools.product((False, True), (controllers, labelled)):
        chosen = load_study({"name": "study", "axes": [gain, axes]})
        assert [chosen.points[i]["controller"] for i in range(2)] == axes.get("labels", [*laws])
        variant = dataclasses.replace(chosen, native=native)
        starts = variant.files().start_values
        gains = [variant.system(i, starts).components["controller"].parameters["gain.attitude"] for i in range(4)]
        assert gains == [*laws.values(), *(2.0 * gain for gain in laws.values())]


def test_a_study_file_names_a_system_file_and_may_multiply_start_values_of_fmus(system: System, tmp_path: Path) -> None:
    file = tmp_path / "study.toml"
    file.write_text(f'scenario = "{FILE}"\n[[axes]]\nname = "gain"\nmultiplies = ["{K_D}"]\nvalues = [1.0, 3]\n')
    chosen = load_study(file)
    starts = chosen.files().start_values
    assert [chosen.system(i, starts).components["controller"].parameters for i in range(2)] == [
        {"k_d": 1.0}, {"k_d": 3.0},
    ]  # fmt: skip


def test_an_fmu_may_be_an_axis(system: System, tmp_path: Path) -> None:
    """The controller by its file and by a copy of it: two runs with equal bits but different indices."""
    fmu = Study(name="s", base=system, axes=(axis("seed", 1),)).files().fmus[system.components["controller"].fmu]
    copy = tmp_path / "other.fmu"
    copy.write_bytes(fmu.read_bytes())
    base = dataclasses.replace(system, stop_time=1.0)
    chosen = Study(name="study", base=base, axes=(axis("components.controller.fmu", str(fmu), str(copy)),))
    sweep(chosen, out=tmp_path)
    first, second = bits(store_path("study", tmp_path))
    assert first["key"] == second["key"], "expected the content to count"
    assert first["late"] == second["late"]


@pytest.mark.parametrize(
    ("target", "said"),
    [
        (
            "timing.period",
            "timing.period: no such path; expected stop_time, seed or one that begins with",
        ),
        (
            "components.tank.step",
            "components.tank.step: expected components.NAME.KEY with NAME one of plant, controller",
        ),
        ("components.plant.sampling.period", "components.plant.sampling.period: no such key; expected"),
        ("connections.command.dely", "did you mean delay?"),
    ],
)
def test_an_axis_that_a_system_does_not_have_is_refused_in_one_line(system: System, target: str, said: str) -> None:
    with pytest.raises(UsageError) as caught:
        Study(name="study", base=system, axes=(axis(target, 1.0),))
    assert said in one_line(caught.value)


@pytest.mark.parametrize(
    ("target", "value", "said"),
    [
        ("components.controller.parameters.k_q", 1.0, "k_q"),
        ("components.controller.parameters.x", 1.0, "expected a parameter, an input that nothing is connected to"),
        (K_D, "stiff", f"{K_D} = stiff: expected a number"),
        (PERIOD, -1.0, f"{PERIOD} = -1.0: expected a positive number"),
        ("connections.command.loss", "often", "connections.command.loss = often: expected a probability"),
        ("connections.command.noise.u", "much", "connections.command.noise of u = much: expected zero or positive"),
        ("connections.command.noise", "{u=1}", "for all signals, or for one as connections.command.noise.u=0.001"),
        ("connections.command.noise.v", 1.0, "connections.command.noise: v is no signal of it; expected one of u"),
        ("components.controller.fmu", 3.0, "fmu = 3.0: expected"),
    ],
)
def test_an_invalid_run_refuses_the_study_of_a_system(
    system: System, tmp_path: Path, target: str, value: Any, said: str
) -> None:
    with pytest.raises(UsageError) as caught:
        sweep(Study(name="study", base=system, axes=(axis(target, value),)), out=tmp_path)
    assert said in one_line(caught.value)
    assert list(tmp_path.iterdir()) == []


def test_objectives_that_are_invalid_as_columns_are_refused() -> None:
    for names in (["status"], ["GOOD"], ["peak", "Peak"], [""], ["guid.x"]):
        with pytest.raises(UsageError, match=f"objectives.{names[-1]}: the table of runs has a column of that name"):
            expect_columns(names)
    expect_columns(['a "quoted" one', "control_effort.thrust"])
    assert is_column("peak", ["peak"])
    assert not is_column("peak", [])


def test_an_objective_of_any_name_is_a_column(system: System, tmp_path: Path) -> None:
    odd = dataclasses.replace(system, stop_time=0.5, objectives={'a "b"; c': "max(plant.x)"}, criterion=Criterion())
    path = sweep(Study(name="study", base=odd, axes=(axis("seed", 1),)), out=tmp_path).path
    with open_for_reading(path) as store:
        (row,) = store.rows()
    assert (row['a "b"; c'], row["outcome"], row["good"]) == (1.0, None, None)


# -- growth -----------------------------------------------------------------------------------------------


def theory(period: float, delay: float) -> float:
    """The logarithm of the spectral radius of the sampled loop, by the second [1/s]."""
    whole = math.floor(delay / period + 1e-9)
    rest = delay - whole * period if delay - whole * period > 1e-12 else 0.0
    pending = whole + (rest > 0.0)
    size = 2 + pending
    newest = np.zeros((1, size))
    newest[0, :2] = -1.0
    sent = [np.eye(1, size, 2 + i) for i in range(pending)] + [newest]
    flow = np.eye(2, size)
    for h, command in ((rest, sent[0]), (period - rest, sent[1] if rest else sent[0])):
        flow = np.array([[1.0, h], [0.0, 1.0]]) @ flow + np.array([[h * h / 2.0], [h]]) @ command
    return math.log(np.abs(np.linalg.eigvals(np.vstack([flow, *sent[1:]]))).max()) / period


@pytest.mark.parametrize(
    ("period", "delay"), [(1.5, 0.0), (2.01, 0.0), (0.5, 0.3), (0.5, 0.7), (0.05, 0.68), (0.05, 0.69)]
)
def test_the_twins_diverge_as_the_eigenvalues_of_the_loop_predict(
    system: System, instances: Instances, period: float, delay: float
) -> None:
    varied = changed(system, {PERIOD: period, DELAY: delay})
    assert growth_of(varied, instances).rate == pytest.approx(theory(period, delay), abs=1e-8)


def test_the_twins_diverge_as_the_loop_linearised_through_saved_states_predicts(instances: Instances) -> None:
    period = 0.081
    scenario = Scenario(stop_time=8.0, timing=Timing(period=period, plant_interval=0.02))
    expected = math.log(HoverLoop.of(scenario).spectral_radius(period, 0.0)) / period
    assert growth_of(scenario.as_system(), instances).rate == pytest.approx(expected, abs=1e-6)


def test_noise_loss_and_jitter_do_not_change_the_growth(system: System, instances: Instances) -> None:
    clear = changed(system, {PERIOD: 0.5})
    noisy = changed(
        clear,
        {"connections.measurement.noise": 0.1, "connections.command.loss": 0.2,
         "components.controller.sampling.jitter": 0.1, "connections.measurement.quantisation": 0.1},
    )  # fmt: skip
    assert growth_of(noisy, instances) == growth_of(clear, instances)


def test_a_point_that_is_not_at_rest_is_refused_naming_what_moves(system: System, instances: Instances) -> None:
    moving = dataclasses.replace(system, operating_point={"components.plant.parameters.initial.x": 1.0})
    with pytest.raises(UsageError, match=r"not at rest: \S+ goes from .* values in \[operating_point\]"):
        growth_of(moving, instances)


# -- limits -----------------------------------------------------------------------------------------------


def test_the_largest_period_of_the_double_integrator_is_two_seconds(system: System) -> None:
    long = dataclasses.replace(system, stop_time=100.0)
    found = limit(long, PERIOD, first=1.9, last=2.1, scan=0.1, tolerance=0.02)
    assert found.local_accuracy is not None
    assert 0.0 < found.local_accuracy < 1e-6
    assert found.local_limit == pytest.approx(2.0, abs=found.local_accuracy)
    assert found.local_method is not None
    assert "through saved states" in found.local_method
    assert found.large_signal_limit == pytest.approx(2.0, abs=0.1)  # near 2 s it decays more slowly than the horizon
    assert found.confidence is None


def test_without_an_operating_point_there_is_no_local_limit_with_the_reason_noted(system: System) -> None:
    nowhere = dataclasses.replace(system, operating_point={}, stop_time=5.0)
    found = limit(nowhere, K_D, first=1.0, last=2.0, scan=1.0)
    assert (found.local_limit, found.local_method) == (None, None)
    assert "the system file names no operating_point" in "\n".join(found.notes)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (
            {"of": "period"},
            "of = period: for the quadrotor only; expected a path, as components.NAME.sampling.period",
        ),
        ({"of": "mass"}, "of = mass: expected a path, as connections.NAME.delay"),
        ({"of": "connections.command.order"}, "of = connections.command.order: expected the path of a number"),
        ({"of": "connections.9.delay"}, "connections.9.delay: expected connections.NAME.KEY"),
        ({"of": "components.plant.parameters.initial.x"}, "expected first and last"),
        (
            {"of": DELAY, "first": 1.0, "last": 0.5},
            "first = 1, last = 0.5: expected finite numbers, the first one smaller",
        ),
        ({"of": DELAY, "first": -1.0, "last": 0.5}, "delay = -1.0: expected zero or a positive number"),
        ({"of": DELAY, "first": 0.0, "last": 0.5, "continuous": True}, "continuous: for the quadrotor only"),
    ],
)
def test_invalid_requests_for_a_system_are_refused_in_one_line(
    system: System, options: dict[str, Any], said: str
) -> None:
    with pytest.raises(UsageError) as caught:
        limit(system, **options)
    assert said in one_line(caught.value)


def test_a_system_without_a_criterion_has_no_limit(system: System) -> None:
    with pytest.raises(UsageError, match=r"criterion.good: expected in the system file"):
        limit(dataclasses.replace(system, criterion=Criterion()), DELAY, first=0.0, last=1.0)


def test_the_command_prints_the_limit_of_a_path_as_json(main: Main) -> None:
    options = ["--of", DELAY, "--from", "0", "--to", "4", "--scan", "2", "--tolerance", "1", "--set", "stop_time=10"]
    found = json.loads(main("limit", FILE, *options, "--json").stdout)
    assert (found["of"], found["scan"], found["tolerance"]) == (DELAY, 2.0, 1.0)
    assert {"local_limit", "large_signal_limit", "confidence", "local_method"} <= found.keys()
    line = error_line(main("limit", FILE, "--of", "connections.command.dely", code=2))
    assert "did you mean delay?" in line
