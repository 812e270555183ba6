"""Scenarios: what a file may say, what is refused and how, and that a scenario survives being written."""

from dataclasses import Field, fields
from pathlib import Path
from typing import Any, get_args, get_type_hints

import pytest
import tomli_w
from hypothesis import given
from hypothesis import strategies as st

from orchestration.command.flags import FlightFlags
from orchestration.foundation.basics.documents import read_toml
from orchestration.quadrotor.scenarios.timing import TIMING_KEYS
from quadcosim import Distribution, FmuChoice, Record, ReferenceChoice, Scenario, Timing, UsageError, load_scenario
from tests.orchestration.quadrotor.scenarios.strategies import timings
from tests.places import ROOT


@pytest.fixture
def file(tmp_path: Path) -> Path:
    return tmp_path / "scenario.toml"


def loaded(file: Path, text: str) -> Scenario:
    file.write_text(text, encoding="utf-8")
    return load_scenario(file)


def refusal(file: Path, text: str) -> str:
    """The one line in which a file is refused, without its path."""
    with pytest.raises(UsageError) as refused:
        loaded(file, text)
    message = str(refused.value)
    assert message.startswith(f"{file}: ")
    assert "\n" not in message
    return message.removeprefix(f"{file}: ")


# -- loading ----------------------------------------------------------------------------------------------


def test_an_empty_file_is_the_scenario_of_the_defaults(file: Path) -> None:
    assert loaded(file, "") == Scenario()


def test_a_file_sets_what_it_names(file: Path) -> None:
    scenario = loaded(
        file,
        """
        stop_time = 3.5
        seed = 7
        [timing]
        period = 0.02
        order = "jacobi"
        hold = "first"
        noise = { position = 0.01, "velocity.x" = 0.1 }
        [record]
        plant = ["tilt"]
        """,
    )
    assert (scenario.stop_time, scenario.seed) == (3.5, 7)
    noise = {"position": 0.01, "velocity.x": 0.1}
    assert scenario.timing == Timing(period=0.02, order="jacobi", hold="first", noise=noise)
    assert scenario.record == Record(plant=("tilt",))


@pytest.mark.parametrize(
    "text",
    [
        '[controller]\n"gain.eta" = 12.0\n"trajectory.start_z" = 1.0',
        "[controller]\ngain.eta = 12.0\ntrajectory.start_z = 1.0",
        "[controller.gain]\neta = 12.0\n[controller.trajectory]\nstart_z = 1.0",
        "controller = { gain = { eta = 12.0 }, trajectory.start_z = 1.0 }",
    ],
)
def test_nested_and_dotted_parameter_names_mean_the_same(file: Path, text: str) -> None:
    assert loaded(file, text).controller.parameters == {"gain.eta": 12.0, "trajectory.start_z": 1.0}


def test_parameters_may_be_nested_deeply(file: Path) -> None:
    scenario = loaded(file, "[plant.initial.position]\nx = 1.0\n[plant.wind]\nfrequency = 2.0")
    assert scenario.plant.parameters == {"initial.position.x": 1.0, "wind.frequency": 2.0}


def test_whole_numbers_are_times_and_booleans_stay_booleans(file: Path) -> None:
    scenario = loaded(file, "stop_time = 3\n[controller]\nuse_reference_inputs = false\n[timing]\ndelay = 1")
    assert scenario.stop_time == 3.0
    assert scenario.timing.delay == 1.0
    assert scenario.controller.parameters == {"use_reference_inputs": False}
    assert scenario.controller.parameters["use_reference_inputs"] is False


def test_paths_are_relative_to_the_folder_of_the_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = tmp_path / "study"
    folder.mkdir()
    (folder / "scenario.toml").write_text('[plant]\nfmu = "own/P.fmu"\n[reference]\nfile = "path.csv"')
    monkeypatch.chdir(tmp_path)
    scenario = load_scenario("study/scenario.toml")
    assert Path(scenario.plant.fmu).absolute() == folder / "own" / "P.fmu"
    assert scenario.reference.file is not None
    assert scenario.reference.file.absolute() == folder / "path.csv"
    assert scenario.controller.fmu == "UnifiedController"


def test_absolute_paths_stay(file: Path, tmp_path: Path) -> None:
    scenario = loaded(file, tomli_w.dumps({"plant": {"fmu": str(tmp_path / "P.fmu")}}))
    assert scenario.plant.fmu == str(tmp_path / "P.fmu")


def test_a_scenario_with_relative_paths_means_the_same_wherever_it_is_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    scenario = Scenario(reference=ReferenceChoice(file=Path("path.csv")), plant=FmuChoice(fmu="own/P.fmu"))
    (tmp_path / "elsewhere").mkdir()
    again = loaded(tmp_path / "elsewhere" / "scenario.toml", scenario.to_toml())
    assert again.reference.file == tmp_path / "path.csv"
    assert again.plant.fmu == str(tmp_path / "own" / "P.fmu")


# -- writing ----------------------------------------------------------------------------------------------

_NAMES = st.sampled_from(("position", "velocity.x", "quaternion.w", "angular_velocity"))
_LEVELS = st.dictionaries(_NAMES, st.floats(0.0, 10.0), max_size=3)
_PARAMETERS = st.dictionaries(
    st.sampled_from(("mass", "gain.eta", "trajectory.start_z", "initial.position.x")),
    st.floats(-1e6, 1e6) | st.booleans(),
)


@given(
    timings() | timings(noise={"position": 0.5}, hold="first") | st.just(Timing(clock="fmu")),
    st.floats(1e-6, 1e6),
    st.integers(0, 2**63 - 1),
    _PARAMETERS,
    _LEVELS,
)
def test_a_scenario_written_and_loaded_is_the_same(
    tmp_path_factory: pytest.TempPathFactory,
    timing: Timing,
    stop_time: float,
    seed: int,
    parameters: dict[str, Any],
    levels: dict[str, float],
) -> None:
    scenario = Scenario(
        stop_time=stop_time,
        seed=seed,
        model_mismatch=seed % 2 == 1,
        timing=timing,
        plant=FmuChoice(fmu="QuadrotorPlant", parameters=parameters),
        record=Record(controller=("energy",)),
    ).with_changes(timing={"noise": levels, "quantisation": levels})
    file = tmp_path_factory.getbasetemp() / "round_trip.toml"
    assert loaded(file, scenario.to_toml()) == scenario


WITHOUT_EFFECT = {"model_mismatch"}
"""Keys that only silence a warning"""


@pytest.mark.parametrize(
    "field", [each for each in fields(Scenario) if isinstance(each.default, int | float)], ids=lambda each: each.name
)
def test_a_number_of_a_scenario_is_read_written_shown_and_has_a_flag(field: Field[Any], file: Path) -> None:
    key, default = field.name, field.default
    value = not default if isinstance(default, bool) else 7 if isinstance(default, int) else 7.0
    given: dict[str, Any] = {key: value}
    scenario, home = Scenario(**given), "orchestration/quadrotor/scenarios"
    read = getattr(loaded(file, f"{key} = {str(value).lower()}"), key)
    assert read == value, f"{key} of a file: expected it in `scenario_from_tables` of {home}/file.py"
    assert loaded(file, scenario.to_toml()) == scenario, f"{key}: expected it in `text_of` of {home}/scenario_text.py"
    flags = {each.name for each in fields(FlightFlags)}
    assert key in flags, f"{key}: expected a flag, a field of `FlightFlags` in orchestration/command/flags.py"
    flagged = FlightFlags(**given).applied_to(Scenario())
    assert flagged == scenario, f"{key}: expected `applied_to` in orchestration/command/flags.py to set it"
    reaches = scenario.as_system() != Scenario().as_system()
    assert reaches is not (key in WITHOUT_EFFECT), (
        f"{key}: expected another system by `as_system` of {home}/scenario.py; or it in WITHOUT_EFFECT of this test"
    )
    page = (ROOT / "docs/start.md").read_text(encoding="utf-8")
    assert f"`{key}`" in page, f"{key}: expected it in docs/start.md, among what may be at the top of a scenario"


@pytest.mark.parametrize("field", fields(Timing), ids=lambda each: each.name)
def test_a_key_of_the_timing_reaches_the_system(field: Field[Any]) -> None:
    words, usual = get_args(get_type_hints(Timing)[field.name]), getattr(Timing(), field.name)
    other = (
        {"position": 0.1} if usual == {} else words[-1] if isinstance(usual, str) else 0.002 if usual == 0.0 else 1.5
    )
    given: dict[str, Any] = {field.name: other}
    reaches = Scenario(timing=Timing(**given)).as_system() != Scenario().as_system()
    assert reaches, f"timing.{field.name}: expected its paths in TIMING of quadrotor/scenarios/translation.py"


def test_what_is_written_names_every_timing_key_that_has_a_value(tmp_path: Path) -> None:
    (tmp_path / "s.toml").write_text(Scenario().to_toml(), encoding="utf-8")
    tables = read_toml(tmp_path / "s.toml", "scenario")
    assert set(tables["timing"]) == set(TIMING_KEYS) - {"burst_length", "noise", "quantisation"}
    assert tables["controller"] == {"fmu": "UnifiedController"}
    assert tables["plant"] == {"fmu": "QuadrotorPlant"}


# -- what is refused --------------------------------------------------------------------------------------


def test_an_unknown_key_at_the_top_is_refused_with_those_there_are(file: Path) -> None:
    for text in ("stoptime = 3.0", "[simulation]\nx = 1"):
        message = refusal(file, text)
        assert "no such key" in message
        for key in ("stop_time", "seed", "controller", "plant", "timing", "reference", "record"):
            assert key in message


def test_an_unknown_timing_key_is_refused_with_those_there_are(file: Path) -> None:
    message = refusal(file, "[timing]\nperiodd = 0.1")
    assert message.startswith("timing.periodd: no such key; expected one of ")
    assert all(key in message for key in TIMING_KEYS)


@pytest.mark.parametrize(
    ("text", "place", "keys"),
    [
        ('[reference]\nfil = "a.csv"', "reference.fil", ["file"]),
        ("[record]\nplan = []", "record.plan", ["plant", "controller"]),
    ],
)
def test_an_unknown_key_of_a_table_is_refused_with_those_there_are(
    file: Path, text: str, place: str, keys: list[str]
) -> None:
    message = refusal(file, text)
    assert message.startswith(f"{place}: no such key; expected one of ")
    assert all(key in message for key in keys)


@pytest.mark.parametrize(
    ("text", "place"),
    [
        ('stop_time = "long"', "stop_time = 'long'"),
        ("seed = 1.5", "seed = 1.5"),
        ("seed = true", "seed = True"),
        ("seed = -1", "seed = -1"),
        ("stop_time = 0.0", "stop_time = 0.0"),
        ("stop_time = -1.0", "stop_time = -1.0"),
        ("stop_time = inf", "stop_time = inf"),
        ("timing = 3", "timing = 3"),
        ("plant = 3", "plant = 3"),
        ('[timing]\nperiod = "0.01"', "timing.period = '0.01'"),
        ("[timing]\nperiod = true", "timing.period = True"),
        ("[timing]\nperiod = [0.01]", "timing.period = [0.01]"),
        ('[timing]\norder = "first"', "timing.order = 'first'"),
        ('[timing]\nhold = "second"', "timing.hold = 'second'"),
        ('[timing]\nclock = "plant"', "timing.clock = 'plant'"),
        ('[timing]\njitter_distribution = "cauchy"', "timing.jitter_distribution = 'cauchy'"),
        ("[timing]\nnoise = 0.1", "timing.noise = 0.1"),
        ('[timing.noise]\nposition = "a lot"', "timing.noise.position = 'a lot'"),
        ('[timing]\nburst_length = "a few"', "timing.burst_length = 'a few'"),
        ("[timing]\nperiod = -0.01", "timing.period = -0.01"),
        ("[timing]\njitter = 0.01", "timing.jitter = 0.01"),
        ("[controller]\nfmu = 3", "controller.fmu = 3"),
        ("[plant]\nmass = [1.0]", "plant.mass = [1.0]"),
        ("[reference]\nfile = 3", "reference.file = 3"),
        ("[record]\nplant = 3", "record.plant = 3"),
    ],
)
def test_a_value_of_the_wrong_kind_is_refused_where_it_stands(file: Path, text: str, place: str) -> None:
    assert refusal(file, text).startswith(f"{place}: ")


def test_what_is_not_toml_is_refused(file: Path) -> None:
    assert refusal(file, "period = ").startswith("expected TOML: ")


def test_what_cannot_be_read_is_refused(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="expected a readable scenario file"):
        load_scenario(tmp_path / "none.toml")
    with pytest.raises(UsageError, match="expected a readable scenario file"):
        load_scenario(tmp_path)
    (tmp_path / "binary.toml").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(UsageError, match="expected a readable scenario file: its text is not in UTF-8"):
        load_scenario(tmp_path / "binary.toml")


def test_a_byte_order_mark_is_no_part_of_the_first_key(file: Path) -> None:
    assert loaded(file, "\ufeffstop_time = 3.0") == Scenario(stop_time=3.0)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (f"x = {'[' * 5000}", "expected TOML nested at most 20 deep"),
        (f"plant{'.a' * 100_000} = 1", "expected TOML nested at most 20 deep"),
        ("plant" + ' . "a"' * 30 + " = 1", "expected TOML nested at most 20 deep"),
        (f"[[plant{'.a' * 18}]]\nx.y.z = 1", "expected at most 20 tables and lists in each other"),
        (f"seed = {'9' * 5000}", "expected whole numbers of at most 64 bits"),
        (f"seed = 0x{'f' * 5000}", "seed: expected a whole number from -2^63 to 2^63 - 1"),
        (f"[plant]\nmass = {'9' * 400}", "plant.mass: expected a whole number from -2^63 to 2^63 - 1"),
        ('[reference]\nfile = "a\\u0000"', "reference.file = 'a\\x00': expected text without NUL characters"),
        ('[plant]\n"a\\u0000" = 1', "plant: 'a\\x00': expected a name without NUL characters"),
        (f"# {'x' * 2**20}", "it has more than 1048576 characters"),
        (f'stop_time = "{"x" * 2**19}"', "…: expected a valid number"),
    ],
    ids=range(11),
)
def test_what_no_reader_could_take_is_refused_in_a_short_line(file: Path, text: str, expected: str) -> None:
    message = refusal(file, text)
    assert expected in message
    assert len(message) < 300


@pytest.mark.parametrize("name", ["stop_time", "seed"])
@pytest.mark.parametrize("value", ["a lot", True, None, [1]])
def test_a_scenario_takes_numbers_only(name: str, value: Any) -> None:
    with pytest.raises(UsageError, match=f"^{name} = .*: expected a"):
        Scenario().with_changes(**{name: value})
    with pytest.raises(UsageError, match=r"^timing.noise of position = .*: expected zero or positive"):
        Scenario().with_changes(timing={"noise": {"position": value}})


def test_a_message_gives_numbers_as_they_are_meant() -> None:
    with pytest.raises(UsageError, match=r"^timing.jitter = 0.3: expected less than the period"):
        Timing(jitter=0.1 + 0.2)


@pytest.mark.parametrize(("name", "key"), [("sample_period", "period"), ("sample_offset", "offset")])
def test_the_controllers_own_clock_is_refused_with_the_reason(file: Path, name: str, key: str) -> None:
    message = refusal(file, f"[controller]\n{name} = 0.02")
    assert message.startswith(f"controller.{name}: expected {key} ")
    assert "the master" in message
    with pytest.raises(UsageError, match=f"controller.{name}"):
        Scenario().with_changes(parameters={f"controller.{name}": 0.02})


# -- changes ----------------------------------------------------------------------------------------------


def test_changes_leave_the_scenario_they_start_from() -> None:
    scenario = Scenario(plant=FmuChoice(fmu="QuadrotorPlant", parameters={"mass": 1.1}))
    changed = scenario.with_changes(
        timing={"period": 0.05}, parameters={"plant.gravity": 9.0, "controller.gain.eta": 1.0}, seed=4, stop_time=1.0
    )
    assert scenario == Scenario(plant=FmuChoice(fmu="QuadrotorPlant", parameters={"mass": 1.1}))
    assert (changed.timing.period, changed.timing.delay, changed.seed, changed.stop_time) == (0.05, 0.0, 4, 1.0)
    assert changed.plant.parameters == {"mass": 1.1, "gravity": 9.0}
    assert changed.controller.parameters == {"gain.eta": 1.0}


def test_a_change_may_choose_the_fmu_of_a_side_with_its_parameters() -> None:
    changed = Scenario().with_changes(controller={"fmu": "CascadedController", "velocity_ratio": 1})
    assert changed.controller == FmuChoice(fmu="CascadedController", parameters={"velocity_ratio": 1})


def test_a_changed_parameter_replaces_the_one_before() -> None:
    changed = Scenario().with_changes(parameters={"plant.mass": 1.0}).with_changes(parameters={"plant.mass": 2.0})
    assert changed.plant.parameters == {"mass": 2.0}


def test_no_changes_are_no_change() -> None:
    assert Scenario().with_changes() == Scenario()


@pytest.mark.parametrize("name", ["mass", "plants.mass", "plant.", "plant", ""])
def test_a_parameter_of_neither_side_is_refused(name: str) -> None:
    with pytest.raises(UsageError, match=r"expected controller.NAME, plant.NAME, reference.NAME or disturbance.NAME"):
        Scenario().with_changes(parameters={name: 1.0})


def test_changes_are_checked_like_the_values_of_a_file() -> None:
    with pytest.raises(UsageError, match=r"timing.period = -1.0"):
        Scenario().with_changes(timing={"period": -1.0})
    with pytest.raises(UsageError, match="stop_time = 0"):
        Scenario().with_changes(stop_time=0.0)


def test_loss_in_a_file_means_both_losses_and_the_particular_one_goes_before_it(tmp_path: Path) -> None:
    file = tmp_path / "s.toml"
    file.write_text("[timing]\nloss = 0.2\ncommand_loss = 0.1\n")
    timing = load_scenario(file).timing
    assert (timing.measurement_loss, timing.command_loss) == (0.2, 0.1)


def test_a_preset_in_a_file_is_the_timing_of_that_stack_below_the_keys_of_the_file(tmp_path: Path) -> None:
    file = tmp_path / "s.toml"
    file.write_text('[timing]\npreset = "crazyflie"\ndelay = 0.0\n')
    timing = load_scenario(file).timing
    assert (timing.period, timing.delay) == (0.002, 0.0)


DRAWN = """[timing]
delay = { uniform = [0.001, 0.004] }
jitter = { normal = [0.001, 0.0005], range = [0.0, 0.002] }
command_loss = { file = "trace.csv", column = "lost", order = "as recorded" }
"""


def test_what_is_drawn_is_written_as_in_a_system_file_and_is_the_same_there(tmp_path: Path) -> None:
    scenario = loaded(tmp_path / "s.toml", DRAWN)
    command, sampling = scenario.as_system().connections[1], scenario.as_system().components["controller"].sampling
    assert command.delay == Distribution(uniform=(0.001, 0.004))
    assert command.loss == Distribution(file=tmp_path / "trace.csv", column="lost", order="as recorded")
    assert sampling is not None
    assert sampling.jitter == scenario.timing.jitter == Distribution(normal=(0.001, 0.0005), range=(0.0, 0.002))
    assert loaded(tmp_path / "again.toml", scenario.to_toml()) == scenario
    assert scenario.headline() == "UnifiedController, period 10 ms, delay 1 ms to 4 ms uniform"
    assert FlightFlags(delay="{uniform=[0.001,0.004]}", seed=1).applied_to(Scenario()).timing.delay == command.delay


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("delay = { unifrm = [0, 1] }", "timing.delay.unifrm: no such key; expected one of uniform, normal,"),
        ("delay = { uniform = [1, 0] }", "timing.delay.uniform = [1.0, 0.0]: expected two numbers"),
        ("loss = { uniform = [0, 1] }", "timing.loss = a formula: expected a probability, or values"),
        ("loss = 0.1\nmeasurement_loss = 2", "timing.measurement_loss = 2.0: "),
        ("jitter = { uniform = [0, 0.01] }", "timing.jitter = 0.01: expected less than the period of 0.01 s"),
        ("period = { uniform = [0, 0.01] }", "timing.period = "),
    ],
)
def test_what_cannot_be_drawn_so_is_refused_where_it_stands(file: Path, text: str, said: str) -> None:
    assert refusal(file, f"[timing]\n{text}").startswith(said)
