"""Study files: their content, and errors for invalid ones."""

import re
from collections.abc import Callable
from dataclasses import fields, replace
from pathlib import Path

import pytest

from orchestration.experiments.comparison.file import load_comparison
from orchestration.experiments.studies.checks import check_design
from orchestration.experiments.studies.run_columns import RunColumns
from orchestration.experiments.studies.run_key import design_parts, difference, study_parts
from orchestration.experiments.studies.study import Study
from orchestration.experiments.studies.study_file import load_study
from orchestration.experiments.tuning.tuning_file import load_tuning
from orchestration.quadrotor.scenarios.timing import TIMING_KEYS
from orchestration.quadrotor.scenarios.translation import paths_of
from orchestration.simulation.requests.ranges import unit_at
from orchestration.systems.system.distribution import Distribution
from orchestration.systems.system.model import System
from quadcosim import FmuChoice, Scenario, UsageError
from tests.extent import sample
from tests.orchestration.experiments.studies.common import GRID, at, axis, one_line, starts
from tests.places import ROOT

ONE = '[[axes]]\nname = "seed"\nvalues = [1]\n'


def load(folder: Path, text: str) -> Study:
    (folder / "study.toml").write_text(text)
    return load_study(folder / "study.toml")


def refused(folder: Path, text: str) -> str:
    with pytest.raises(UsageError) as caught:
        load(folder, text)
    line = one_line(caught.value)
    assert line.startswith(f"{folder / 'study.toml'}: ")
    return line


def flown(folder: Path, text: str, index: int = 0) -> System:
    """The system of one run of a study."""
    study = load(folder, text)
    return study.system(index, study.files().start_values)


# -- good files -------------------------------------------------------------------------------------------


@pytest.mark.parametrize("path", sorted((ROOT / "studies").glob("*.toml")), ids=lambda path: path.stem)
def test_every_study_of_the_repository_loads_and_all_its_runs_are_scenarios(path: Path) -> None:
    study = load_study(path)
    known = study.files().start_values
    assert study.name == path.stem
    for index in sample(range(len(study.points)), 20):
        study.system(index, known)


def test_a_grid_is_read_as_it_is_written(tmp_path: Path) -> None:
    study = load(tmp_path, GRID)
    assert [tuple(point.values()) for point in study.points] == [
        (p, d) for p in (0.02, 0.01) for d in (0.0, 0.01, 0.005)
    ]
    last = study.system(5, starts())
    assert [at(last, f"timing.{key}") for key in ("plant_interval", "period", "delay")] == [0.005, 0.01, 0.005]
    assert last.stop_time == 0.1


def test_the_name_is_that_of_the_file_unless_one_is_given(tmp_path: Path) -> None:
    assert load(tmp_path, ONE).name == "study"
    assert load(tmp_path, f'name = "mine"\n{ONE}').name == "mine"


def test_a_number_of_values_spans_the_range(tmp_path: Path) -> None:
    text = '[[axes]]\nname = "p"\nsets = ["timing.period"]\nstart = 0.001\nstop = 0.005\nnumber = 5\n'
    assert [point["p"] for point in load(tmp_path, text).points] == [0.001, 0.002, 0.003, 0.004, 0.005]


def test_a_range_without_a_number_is_sampled_by_the_design(tmp_path: Path) -> None:
    text = '[[axes]]\nname = "plant.mass"\nstart = 0.9\nstop = 1.1\n[design]\nmethod = "latin-hypercube"\nsamples = 7\n'
    masses = [point["plant.mass"] for point in load(tmp_path, text).points]
    assert len(set(masses)) == 7
    assert all(isinstance(mass, float) and 0.9 <= mass <= 1.1 for mass in masses)


def test_sets_puts_the_value_into_each_target(tmp_path: Path) -> None:
    text = '[[axes]]\nname = "i"\nsets = ["plant.inertia.xx", "plant.inertia.yy", "timing.offset"]\nvalues = [0.25]\n'
    system = flown(tmp_path, text)
    assert system.components["plant"].parameters == {"inertia.xx": 0.25, "inertia.yy": 0.25}
    assert at(system, "timing.offset") == 0.25


def test_multiplies_scales_the_value_of_the_base_or_else_the_start_value_of_the_fmu(tmp_path: Path) -> None:
    text = (
        "[base.timing]\nperiod = 0.03\n[base.controller]\ngain.eta = 4.0\n[[axes]]\nname = 'f'\nvalues = [2]\n"
        "multiplies = ['controller.gain.eta', 'controller.gain.theta', 'timing.period']\n"
    )
    system = flown(tmp_path, text)
    assert system.components["controller"].parameters == {"gain.eta": 8.0, "gain.theta": 30.0}
    assert at(system, "timing.period") == 0.06


def test_only_numbers_can_be_multiplied(tmp_path: Path) -> None:
    for target, values in (("timing.order", "[2]"), ("plant.mass", '["heavy"]'), ("plant.nonsense", "[2]")):
        text = f'[[axes]]\nname = "x"\nmultiplies = ["{target}"]\nvalues = {values}\n'
        with pytest.raises(UsageError, match=rf"{target}: expected a number"):
            flown(tmp_path, text)


def test_loss_sets_both_losses(tmp_path: Path) -> None:
    system = flown(tmp_path, '[[axes]]\nname = "loss"\nsets = ["timing.loss"]\nvalues = [0.25]\n')
    assert [x.loss for x in system.connections] == [0.25, 0.25]


def test_an_axis_may_have_distributions_with_their_traces(tmp_path: Path) -> None:
    (tmp_path / "trace.csv").write_text("delay\n0.001\n0.002\n")
    tables = '{ uniform = [0, 0.002] }, { file = "trace.csv", column = "delay" }'
    study = load(tmp_path, f'[[axes]]\nname = "timing.delay"\nvalues = [{tables}]\n')
    trace = Distribution(file=tmp_path / "trace.csv", column="delay")
    found = [study.system(index, starts()).connections[1].delay for index in range(2)]
    assert found == [Distribution(uniform=(0.0, 0.002)), trace]
    assert study.points[0] == {"timing.delay": "{uniform = [0, 0.002]}"}
    assert study.files().tables[str(trace.file)] == trace.file


def test_a_study_in_another_folder_is_the_same_and_its_files_are_those_beside_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    text = (
        '[[axes]]\nname = "controller"\nvalues = ["one.fmu", "UnifiedController"]\n'
        '[[axes]]\nname = "timing.delay"\nvalues = [{ file = "trace.csv", column = "delay" }]\n'
        "[design]\nvary_seed = true\n"
    )
    designs, seeds = [], []
    for name in ("first", "moved"):
        folder = tmp_path / name
        folder.mkdir()
        (folder / "study.toml").write_text(text)
        (folder / "trace.csv").write_text("delay\n0.001\n0.002\n")
        monkeypatch.chdir(folder if name == "first" else tmp_path)
        study = load_study("study.toml" if name == "first" else f"{name}/study.toml")
        monkeypatch.chdir(tmp_path.parent)
        system = study.system(0, {})
        assert system.components["controller"].fmu == str(folder / "one.fmu")
        assert system.connections[1].delay == Distribution(file=folder / "trace.csv", column="delay")
        assert study.system(1, {}).components["controller"].fmu == "UnifiedController"
        designs.append((design_parts(study), [*study.points]))
        seeds.append([study.system(index, {}).seed for index in range(2)])
    assert designs[0] == designs[1]
    assert seeds[0] == seeds[1]


def test_a_study_has_no_parts_that_are_not_set_so_that_older_stores_of_it_are_drawn(tmp_path: Path) -> None:
    assert [name for name in study_parts(load(tmp_path, ONE)) if name.endswith(".points")] == []


def test_a_difference_of_long_texts_shows_where_they_differ() -> None:
    before, now = ("0" * 100 + end + "1" * 100 for end in ("a", "b"))
    said = difference({"axis": before, "one": "1"}, {"axis": now, "one": "2"})
    assert said == f"axis was ...{'0' * 15}a{'1' * 44}..., is ...{'0' * 15}b{'1' * 44}...; one was 1, is 2"


def test_noise_of_one_measurement_leaves_that_of_others(tmp_path: Path) -> None:
    axes = '[[axes]]\nname = "n"\nsets = ["timing.noise.position"]\nvalues = [0.25]\n'
    text = f"[base.timing.noise]\nvelocity = 0.5\n{axes}"
    assert flown(tmp_path, text).connections[0].noise == {"velocity": 0.5, "position": 0.25}


def test_the_noise_of_a_signal_has_its_unit(tmp_path: Path) -> None:
    study = load(tmp_path, '[[axes]]\nname = "n"\nsets = ["timing.noise.position"]\nvalues = [0.25]\n')
    models = study.files().models_of(study.origin)
    own = ("noise.position", "quantisation.angular_velocity.x", "noise.none")
    assert [unit_at(f"connections.measurement.{of}", models) for of in own] == ["m", "rad/s", None]


def test_each_run_has_the_seed_of_the_base_unless_seeds_vary(tmp_path: Path) -> None:
    text = '[base]\nseed = 7\n[[axes]]\nname = "timing.period"\nvalues = [0.01, 0.02, 0.03]\n'
    assert [flown(tmp_path, text, i).seed for i in range(3)] == [7, 7, 7]
    varied = f"{text}[design]\nvary_seed = true\n"
    seeds = [flown(tmp_path, varied, i).seed for i in range(3)]
    assert len({7, *seeds}) == 4
    assert [flown(tmp_path, varied.replace("[0.01, ", "[0.04, 0.01, "), i + 1).seed for i in range(3)] == seeds
    assert flown(tmp_path, varied.replace("seed = 7", "seed = 8")).seed not in seeds


def test_an_axis_of_seeds_overrides_varying_seeds(tmp_path: Path) -> None:
    text = '[[axes]]\nname = "seed"\nvalues = [5, 5, 9]\n[design]\nvary_seed = true\n'
    assert [flown(tmp_path, text, i).seed for i in range(3)] == [5, 5, 9]


def test_signals_are_kept_of_none_of_some_or_of_all(tmp_path: Path) -> None:
    text = '[[axes]]\nname = "seed"\nvalues = [1, 2, 3]\n'
    for given, kept in (("", []), ("keep_signals = true\n", [0, 1, 2]), ("keep_signals = [2, 0]\n", [0, 2])):
        study = load(tmp_path, given + text)
        assert [index for index in range(3) if study.keeps_signals(index)] == kept


def test_the_base_may_be_the_path_of_a_scenario_from_the_folder_of_the_study(tmp_path: Path) -> None:
    (tmp_path / "flight.toml").write_text("stop_time = 3.0\n[timing]\nperiod = 0.07\n")
    base = load(tmp_path, f'scenario = "flight.toml"\n{ONE}').base
    assert isinstance(base, Scenario)
    assert (base.stop_time, base.timing.period) == (3.0, 0.07)


def test_without_a_base_it_is_the_flight_of_the_paper(tmp_path: Path) -> None:
    assert load(tmp_path, ONE).base == Scenario()


# -- what cannot be ---------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "place", "valid"),
    [
        ("nonsense = 1\n" + ONE, "nonsense", "name, scenario, base, axes, design, keep_signals"),
        (ONE + "steps = 3\n", "steps", "name, sets, multiplies, values, start, stop, number, scale, labels"),
        (ONE + "[design]\nsteps = 3\n", "design.steps", "method, samples, seed, vary_seed"),
        ("[base]\nduration = 3\n" + ONE, "duration", ", ".join(field.name for field in fields(Scenario))),
        ("[base.timing]\nrate = 3\n" + ONE, "timing.rate", ", ".join(TIMING_KEYS)),
    ],
)
def test_an_unknown_key_is_reported_with_the_known_ones(tmp_path: Path, text: str, place: str, valid: str) -> None:
    line = refused(tmp_path, text)
    assert f"{place}: no such key; expected one of {valid}" in line


@pytest.mark.parametrize("load", [load_study, load_comparison, load_tuning])
@pytest.mark.parametrize("key", ["stop_time = 1.0", "components.servo.step = 0.1"])
def test_a_system_in_place_of_a_file_that_names_one_is_refused_with_what_names_it(
    load: Callable[[Path], object], key: str, tmp_path: Path
) -> None:
    path = tmp_path / "system.toml"
    path.write_text(key)
    with pytest.raises(
        UsageError, match=r"m\.toml: (stop_time|components): no such key; .*, which scenario = .FILE\.t"
    ):
        load(path)


def test_metrics_of_ones_own_are_objectives_of_the_base_and_elsewhere_the_error_says_so(tmp_path: Path) -> None:
    tilt = 'tilt_max = "max(plant.tilt)"\n'
    study = load(tmp_path, f"[base.objectives]\n{tilt}{ONE}")
    assert study.metric_names[-1] == "tilt_max"
    assert study.system(0, {}).objectives["tilt_max"] == "max(plant.tilt)"
    (tmp_path / "base.toml").write_text(study.base.to_toml())
    assert load(tmp_path, f'scenario = "base.toml"\n{ONE}').base.as_system() == study.base.as_system()
    for text, there in ((f"[metrics]\n{tilt}{ONE}", "[base.objectives]"), (f"[base.metrics]\n{tilt}{ONE}", "[obj")):
        assert f"metrics: no such key; metrics of your own are expressions under {there}" in refused(tmp_path, text)
    for table in ("controllers", "base.controllers"):
        assert 'a vehicle file, vehicle = "FILE.toml"' in refused(tmp_path, f"[{table}.X]\nvelocity_ratio = 1\n{ONE}")
    with pytest.raises(UsageError, match=r"^design: no such key; the keys of \[design\] are arguments: .*, repeat$"):
        Study(name="a", base=study.base, axes=study.axes, design={"repeat": 3})  # type: ignore[call-arg]
    taken = refused(tmp_path, f'[base.objectives]\nposition_max = "1"\n{ONE}')
    assert "objectives: position_max: expected another name; this one is taken" in taken


@pytest.mark.parametrize("target", ["timing.rate", "nonsense", "wind.amplitude.x", "timing", "plant", ""])
def test_an_unknown_target_is_reported_with_the_known_ones(tmp_path: Path, target: str) -> None:
    line = refused(tmp_path, f'[[axes]]\nname = "x"\nsets = ["{target}"]\nvalues = [1]\n')
    assert f"{target}: expected controller.NAME, plant.NAME, reference.NAME, disturbance.NAME, seed, " in line
    assert ", ".join(key for key in TIMING_KEYS if key not in ("noise", "quantisation")) in line


@pytest.mark.parametrize("target", ["timing.perod", "period"])
def test_of_an_unknown_target_the_closest_is_named(target: str) -> None:
    with pytest.raises(UsageError, match=r"; did you mean timing.period\?$"):
        paths_of(target)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "axes = none: expected at least one axis"),
        ('[[axes]]\nname = "steps"\nsets = ["timing.period"]\nvalues = [0.1]\n', "axis steps: the table of runs has"),
        ('[[axes]]\nname = "seed"\nsets = ["timing.period"]\nvalues = [0.1]\n', "axis seed: the table of runs has"),
        (
            '[[axes]]\nname = "x"\nsets = ["seed"]\nvalues = [1, true]\n',
            "axis x: expected values of one kind: numbers, texts, or true and false; there are 1, True",
        ),
        ('name = "../evil"\n' + ONE, "name = '../evil': expected the name of a folder"),
        (ONE + ONE, "axes = seed, seed: expected at least one axis, each with its own name"),
        (ONE + "sets = ['seed']\nmultiplies = ['seed']\n", "axis seed: expected sets or multiplies, not both"),
        (ONE + "start = 1\nstop = 2\n", "axis seed: expected values, or start and stop"),
        (ONE + "number = 2\n", "axis seed: expected values, or start and stop"),
        ('[[axes]]\nname = "seed"\nvalues = []\n', "axis seed: expected at least one value"),
        ('[[axes]]\nname = "seed"\nstart = 1\n', "axis seed: expected values, or start and stop"),
        ('[[axes]]\nname = "seed"\n', "axis seed: expected values, or start and stop"),
        ('[[axes]]\nname = "seed"\nstart = 2\nstop = 1\nnumber = 3\n', "axis seed: "),
        ('[[axes]]\nname = "seed"\nstart = 1\nstop = 2\n', "design.samples = 0: expected at least 1"),
        (ONE + '[design]\nmethod = "guess"\n', "design.method = 'guess'"),
        (ONE + '[base]\n[base.timing]\nperiod = -1.0\n', "timing.period = -1.0: expected a positive number"),
        (
            'scenario = "flight.toml"\n[base]\nstop_time = 1.0\n[base.objectives]\nm = "1"\n' + ONE,
            "scenario and base: expected one of them; put stop_time, [objectives] into flight.toml",
        ),
        ('scenario = "nowhere.toml"\n' + ONE, "nowhere.toml: expected a readable system or scenario file"),
        ("[[axes\n", "expected TOML"),
    ],
)  # fmt: skip
def test_an_invalid_file_is_refused_in_one_line(tmp_path: Path, text: str, said: str) -> None:
    assert said in refused(tmp_path, text)


def test_a_missing_file_is_reported(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=r"nowhere.toml: expected a readable study file") as caught:
        load_study(tmp_path / "nowhere.toml")
    one_line(caught.value)


def test_a_file_that_is_no_text_is_reported(tmp_path: Path) -> None:
    (tmp_path / "study.toml").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(UsageError, match="expected a readable study file"):
        load_study(tmp_path / "study.toml")


def test_the_stop_time_may_be_an_axis(tmp_path: Path) -> None:
    file = tmp_path / "study.toml"
    file.write_text('[[axes]]\nname = "stop_time"\nvalues = [0.1, 0.2]\n')
    chosen = load_study(file)
    assert [chosen.system(i, {}).stop_time for i in range(2)] == [0.1, 0.2]


def test_noise_without_a_measurement_is_refused_as_a_target(tmp_path: Path) -> None:
    assert "timing.noise: expected" in refused(tmp_path, '[[axes]]\nname = "timing.noise"\nvalues = [0.1]\n')


DESIGNS = '[[axes]]\nname = "design"\nsets = ["seed", "stop_time"]\nvalues = '


@pytest.mark.parametrize(
    ("rest", "said"),
    [
        ("[[1, 2.0], [2]]", "axis design: values has [2]: expected lists of values, one for each path of sets = ["),
        ("[[1, 2.0], 2]", "axis design: values has 2: expected lists of values, one for each"),
        ("[[1, 2.0], [1, 2.0]]", "expected a different one for each value"),
        ("[[1, [2.0]]]", "axes.0.values.0 = [1, [2.0]]: expected a valid boolean, integer, number or string"),
        ('[[1, 2.0]]\nlabels = ["a", "b"]', "labels = ['a', 'b']: expected a different one for each value"),
    ],
)
def test_a_design_has_a_value_for_each_path(tmp_path: Path, rest: str, said: str) -> None:
    designs = load(tmp_path, f'{DESIGNS}[[1, 2.0], [3, 4.0]]\nlabels = ["a", "b"]\n')
    systems = [designs.system(i, {}) for i in (0, 1)]
    assert [point["design"] for point in designs.points] == ["a", "b"]
    assert [(system.seed, system.stop_time) for system in systems] == [(1, 2.0), (3, 4.0)]
    assert said in refused(tmp_path, f"{DESIGNS}{rest}\n")


def test_a_design_sets_no_path_for_which_it_has_an_empty_table(tmp_path: Path) -> None:
    base = "[base]\nseed = 5\nstop_time = 7.0\n"
    designs = load(tmp_path, f'{base}{DESIGNS}[[1, {{}}], [{{}}, 4.0]]\nlabels = ["a", "b"]\n')
    systems = [designs.system(i, {}) for i in (0, 1)]
    assert [(system.seed, system.stop_time) for system in systems] == [(1, 7.0), (5, 4.0)]


LAWS = '[[axes]]\nname = "law"\nsets = ["controller"]\nvalues = ["UnifiedController", "CascadedController"]\n'


def test_parameters_of_one_law_stand_in_a_vehicle_file_and_elsewhere_the_error_says_so(tmp_path: Path) -> None:
    (page,) = re.findall(r"```toml one_rate.toml\n(.*?)```", (ROOT / "docs" / "studies.md").read_text(), re.S)
    (tmp_path / "one_rate.toml").write_text(page)
    study = load(tmp_path, f'[base]\nvehicle = "one_rate.toml"\n{LAWS}')
    laws = [study.system(index, {}).components["controller"].parameters for index in (0, 1)]
    assert laws == [{}, {"velocity_ratio": 1, "attitude_ratio": 1}]
    labels = 'labels = ["law", "cascade"]\n'
    named = load(tmp_path, f'[base]\nvehicle = "one_rate.toml"\n{LAWS}{labels}')
    assert [named.system(index, {}) for index in (0, 1)] == [study.system(index, {}) for index in (0, 1)]
    assert "labels = ['law']: expected a different one for each" in refused(tmp_path, LAWS + "labels = ['law']\n")
    designs = 'values = [["UnifiedController", 7.0], ["CascadedController", 9.0]]'
    both = re.sub("values = .*", designs, LAWS.replace('"controller"', '"controller", "stop_time"'))
    pairs = load(tmp_path, f'[base]\nvehicle = "one_rate.toml"\n{both}')
    assert [pairs.points[index]["law"] for index in (0, 1)] == ["UnifiedController, 7.0", "CascadedController, 9.0"]
    assert [pairs.system(index, {}) for index in (0, 1)] == [
        replace(study.system(index, {}), stop_time=7.0 + 2.0 * index) for index in (0, 1)
    ]
    there = r"\[controllers.NAME\] of a vehicle file, vehicle = \"FILE\" under \[base\]"
    other = load(tmp_path, f"[base.controller]\nvelocity_ratio = 1\n{LAWS}")
    with pytest.raises(UsageError, match=f"controller.velocity_ratio: UnifiedController has no .*{there}"):
        check_design(RunColumns(other, other.files()))
    table = LAWS.replace('"CascadedController"', '{ fmu = "CascadedController", velocity_ratio = 1 }')
    with pytest.raises(UsageError, match=f"axis law: expected controllers by name or path; .*{there}"):
        load(tmp_path, table)
    choice = FmuChoice(fmu="CascadedController", parameters={"velocity_ratio": 1})
    with pytest.raises(UsageError, match=f"axis controller: expected controllers by name or path; .*{there}"):
        Study(name="s", base=Scenario(), axes=(axis("controller", "UnifiedController", choice),))
