"""A comparison is a study: the same starts and the same chance for every controller, on every vehicle."""

import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from orchestration.experiments.comparison.design import Comparison
from orchestration.experiments.comparison.file import load_comparison
from orchestration.experiments.studies.run_key import design_parts
from orchestration.systems.system.model import System
from orchestration.systems.system.paths import value_at
from quadcosim import UsageError
from tests.places import EXAMPLES, ROOT

FILE = Path(__file__).with_name("test_design.toml").read_text(encoding="utf-8")
CELLS = 2 * 2 * 2 * 3
MASS, NOMINAL = "components.plant.parameters.mass", "components.controller.parameters.mass"
COUPLING = "components.controller.parameters.coupling"
SURFACE = "components.controller.parameters.gain.surface"


@pytest.fixture
def file(tmp_path: Path) -> Path:
    light = '[plant]\nmass = 0.5\n[controller]\n"mass" = 0.5\n[controllers.UnifiedController]\ngain.eta = 7.0\n'
    (tmp_path / "light.toml").write_text(light)
    for vehicle in ("light", "heavy"):
        for milli, gain in (("10", 5.0), ("20", 4.0), ("40", 3.0)):
            text = f"[controller]\ngain.surface = {gain if vehicle == 'light' else 2 * gain}\n"
            (tmp_path / f"gains_{vehicle}_{milli}ms.toml").write_text(text)
    path = tmp_path / "laws.toml"
    path.write_text(FILE)
    return path


@pytest.fixture
def comparison(file: Path) -> Comparison:
    return load_comparison(file)


def systems(comparison: Comparison, **of: object) -> list[System]:
    """Of all runs of the cells that are these."""
    chosen = [cell for cell in comparison.cells() if all(getattr(cell, key) == value for key, value in of.items())]
    return [comparison.study.system(i, {}) for cell in chosen for i in comparison.runs_of(cell)]


def test_every_controller_is_run_on_every_vehicle_condition_value_and_initial_condition(comparison: Comparison) -> None:
    cells = [*comparison.cells()]
    assert len(cells) == CELLS
    assert len(comparison.study.points) == CELLS * 5
    for cell in cells:
        for start, index in enumerate(comparison.runs_of(cell)):
            assert comparison.study.points[index] == {
                "vehicle": cell.vehicle, "condition": cell.condition, "controller": cell.controller,
                "period": cell.value, "start": start,
            }  # fmt: skip


def test_starts_and_seeds_are_the_same_for_every_controller_and_differ_from_each_other(comparison: Comparison) -> None:
    def begun(system: System) -> tuple[object, ...]:
        plant = system.components["plant"].parameters
        return (system.seed, *(plant[name] for name in sorted(plant) if name.startswith("initial.")))

    first = [begun(system) for system in systems(comparison, controller="plain", vehicle="light", value=0.01)[:5]]
    assert len(set(first)) == 5
    assert [seed for seed, *_ in first] == [40, 41, 42, 43, 44]
    for cell in comparison.cells():
        assert [begun(comparison.study.system(i, {})) for i in comparison.runs_of(cell)] == first


def test_a_condition_multiplies_what_the_vehicle_sets_and_leaves_what_the_controller_believes(
    comparison: Comparison,
) -> None:
    for vehicle, mass in (("light", 0.5), ("heavy", 2.0)):
        for condition, factor in (("nominal", 1.0), ("mismatch", 1.5)):
            for system in systems(comparison, vehicle=vehicle, condition=condition):
                assert value_at(system, MASS) == mass * factor
                assert value_at(system, NOMINAL) == mass
                lost = 0.0 if condition == "nominal" else 0.1
                assert [value_at(system, f"connections.{x}.loss") for x in ("measurement", "command")] == [lost, lost]


def test_a_vehicle_may_tell_a_controller_of_its_own_what_it_tells_no_other(comparison: Comparison) -> None:
    own = {
        system.components["controller"].parameters.get("gain.eta") for system in systems(comparison, vehicle="light")
    }
    other = replace(comparison.controllers[0], sets={"controller.fmu": "GeometricController"})
    changed = replace(comparison, controllers=(other,))
    assert own == {7.0}
    for system in systems(changed, vehicle="light"):
        assert "gain.eta" not in system.components["controller"].parameters
        assert value_at(system, NOMINAL) in (0.5, 0.75)


def test_an_fmu_of_a_comparison_is_found_beside_its_file_and_the_design_does_not_name_the_folder(file: Path) -> None:
    file.write_text(FILE.replace("native/UnifiedController", "own.fmu"))
    comparison = load_comparison(file)
    own = str(file.parent / "own.fmu")
    assert comparison.fmu_of(comparison.controllers[1]) == own
    assert {system.components["controller"].fmu for system in systems(comparison, controller="tuned")} == {own}
    assert str(file.parent) not in "".join(design_parts(comparison.study).values())


def test_gains_may_lie_in_a_file_for_each_vehicle_and_value_with_parameters_on_top(comparison: Comparison) -> None:
    for system in systems(comparison, controller="plain"):
        assert value_at(system, COUPLING) is value_at(system, SURFACE) is None
        assert system.components["controller"].fmu == "UnifiedController"
    for vehicle, factor in (("light", 1.0), ("heavy", 2.0)):
        for value, gain in ((0.01, 5.0), (0.02, 4.0), (0.04, 3.0)):
            for system in systems(comparison, controller="tuned", vehicle=vehicle, value=value):
                assert value_at(system, SURFACE) == factor * gain
                assert value_at(system, COUPLING) == 0.0
                assert system.components["controller"].fmu == "native/UnifiedController"


def test_a_run_is_the_scenario_that_means_it(comparison: Comparison) -> None:

    for index in (0, 37, len(comparison.study.points) - 1):
        assert comparison.request(index, {}).as_system() == comparison.study.system(index, {})


def test_the_native_twins_are_taken_of_all_fmus(comparison: Comparison) -> None:
    for system in systems(replace(comparison, native=True)):
        assert all(fmu.startswith("native/") for fmu in system.fmus.values())


SCHEDULED = 'scheduled = { gain.surface = "0.05 / period", gain.eta = "4 + period" }'
"""Beside the files of gains, one of which it overrules"""


def test_scheduled_parameters_follow_the_axis_on_top_of_all_others(file: Path) -> None:
    file.write_text(FILE.replace("[[vehicles]]", f"{SCHEDULED}\n[[vehicles]]", 1))
    for period in (0.01, 0.02, 0.04):
        for system in systems(load_comparison(file), controller="tuned", value=period):
            assert value_at(system, SURFACE) == 0.05 / period
            assert value_at(system, "components.controller.parameters.gain.eta") == 4.0 + period
            assert value_at(system, COUPLING) == 0.0
    for system in systems(load_comparison(file), controller="plain"):
        assert value_at(system, SURFACE) != 5.0


@pytest.mark.parametrize(
    ("before", "after", "words"),
    [
        ('name = "tuned"', 'name = "plain"', "controllers = plain, plain: expected at least one, each with its own"),
        ("gains_{vehicle}_{milli}ms", "gains_{vehikel}", "expected a file, with {vehicle}, {value} of the axis"),
        ("gains_{vehicle}", "no_{vehicle}", "no_light_10ms.toml: expected a readable file of parameters"),
        ("light.toml", "laws.toml", "base: expected the tables [plant], [controller]"),
        ("values = [0.01, 0.02, 0.04]", "values = [0.02, 0.01]", "axis period: expected increasing values"),
        ('name = "period"', 'name = "start"', "axis start: expected another name"),
        ('sets = ["timing.period"]', 'sets = ["timing.perod"]', "timing.perod: expected controller.NAME"),
        ('"plant.mass" = 1.5', '"plant.mass" = "much"', "conditions.mismatch.multiplies.plant.mass = much"),
        ('"plant.mass" = 1.5', '"plane.mass" = 1.5', "plane.mass: expected controller.NAME, plant.NAME"),
        ("count = 5", "count = 0", "starts.count = 0: expected a whole number from 1"),
        ("count = 5", "number = 5", "starts.number: no such key; expected one of"),
        ("[axis]", '[front]\neffort = "torque"\n[axis]', "front.effort = torque: expected one of position_rmse"),
        ("[base]", "[bases]", "bases: no such key; expected one of"),
        (
            "[[vehicles]]",
            "scheduled.gain.eta = 4.0\n[[vehicles]]",
            "controllers.tuned.scheduled.gain.eta = 4.0: expected",
        ),
        (
            "[[vehicles]]",
            'scheduled.gain.eta = "1 / perod"\n[[vehicles]]',
            "gain.eta = 1 / perod: there is no perod; expected period",
        ),
        (
            "[[vehicles]]",
            'scheduled.gain.eta = "period > 1"\n[[vehicles]]',
            "period > 1: it is true or false; expected a",
        ),
        ("[[vehicles]]", 'scheduled.gain.eta = "1 / (period - period)"\n[[vehicles]]', "at period = 0.01; expected a"),
    ],
)
def test_invalid_values_are_refused_in_one_line_with_the_file(before: str, after: str, words: str, file: Path) -> None:
    assert before in FILE
    file.write_text(FILE.replace(before, after, 1))
    with pytest.raises(UsageError) as refused:
        load_comparison(file)
    assert words in str(refused.value)
    assert str(refused.value).startswith(f"{file}: ")
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize("key", ["system", "scenario"])
@pytest.mark.parametrize("tables", [lambda one: one, lambda one: {"base": one}], ids=["beside", "base"])
def test_another_system_is_referred_to_a_study_of_it_at_once_wherever_it_stands(tables: Any, key: str) -> None:
    file = tables({key: str(EXAMPLES / "water_tank" / "system.toml")})
    with pytest.raises(UsageError, match=r"of the quadrotor, .* other systems .* an axis over components\.NAME\.fmu$"):
        load_comparison({**file, "controllers": [{"name": "a"}]})


def test_a_cell_that_there_is_not_is_refused(comparison: Comparison) -> None:
    with pytest.raises(UsageError, match=rf"cell = {CELLS}: expected a number from 0 to {CELLS - 1}"):
        comparison.cell(CELLS)


# -- files of the repository ------------------------------------------------------------------------------------------


OF_ATTEMPTS = {"predictor_errors": 50, "predictor_jitter": 50, "separation": 100, "separation_rates": 100}
"""Starts of comparisons that were flown to refute a claim, whose page names how many they are"""


@pytest.mark.parametrize("path", sorted((ROOT / "studies" / "comparisons").glob("*.toml")), ids=lambda p: p.stem)
def test_every_comparison_of_the_repository_loads_and_has_200_starts_or_as_many_as_its_claim_says(path: Path) -> None:
    comparison = load_comparison(path)
    assert len(comparison.initial_conditions) >= OF_ATTEMPTS.get(path.stem, 200)
    for cell in comparison.cells():
        comparison.study.system(comparison.runs_of(cell)[0], {})


def test_the_file_of_the_page_is_one(tmp_path: Path) -> None:
    text, *_ = re.findall(r"```toml\n(.*?)```", (ROOT / "docs" / "compare.md").read_text("utf-8"), re.DOTALL)
    for name in re.findall(r'^file = "(.*?)"', text, re.M):
        for value in range(10, 130, 10):
            made = tmp_path / "page" / "of" / name.format(vehicle="small", milli=value)
            made.parent.mkdir(parents=True, exist_ok=True)
            made.write_text("[controller]\ngain.attitude = 1.0\n")
    file = tmp_path / "page" / "of" / "comparison.toml"
    file.write_text(text)
    comparison = load_comparison(file)
    assert [len(comparison.controllers), len(comparison.vehicles), len(comparison.conditions)] == [2, 1, 2]
