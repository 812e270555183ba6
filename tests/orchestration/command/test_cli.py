"""The command `quadcosim` as a user starts it: what it prints, where, and how it ends."""

import json
import os
import re
import shutil
import signal
import subprocess
import sys
import zipfile
from contextlib import nullcontext
from pathlib import Path
from typing import Any

import pytest

from orchestration.command import plotting
from orchestration.components.building import fmus
from orchestration.components.building.models import MODELS
from orchestration.foundation.processes import subprocesses
from orchestration.foundation.recording.recording import InMemory
from orchestration.quadrotor.flight.names import FIGURES as FLIGHT
from quadcosim import Scenario, Timing, load_run, run, save_run
from tests.commands import Done, Main
from tests.extent import in_test_all, sample
from tests.native import native
from tests.patience import PATIENCE
from tests.places import EXAMPLES, ROOT

SCRIPT = shutil.which("quadcosim", path=str(Path(sys.executable).parent))
SHORT = ("--native", "--stop-time", "0.5")


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder to start from that is not the project's."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


pytestmark = pytest.mark.usefixtures("here")


def quadcosim(*arguments: str | Path, code: int = 0, environment: dict[str, str] | None = None) -> Done:
    assert SCRIPT is not None, "expected the script beside this Python: pip install -e ."
    done = subprocess.run(
        [SCRIPT, *map(str, arguments)],
        capture_output=True, text=True, encoding="utf-8", timeout=PATIENCE, check=False,
        env={**os.environ, "PYTHONIOENCODING": "utf-8", "COLUMNS": "200", "NO_COLOR": "1", **(environment or {})},
    )  # fmt: skip
    assert done.returncode == code, done.stdout + done.stderr
    return done


def flown(**timing: Any) -> dict[str, Any]:
    """The metrics of the same flight by the API."""
    result = run(native(stop_time=0.5, timing=Timing(**timing)))
    return {**result.metrics, "wall_time": None, "engine": result.provenance["engine"]}


def error_line(done: Done) -> str:
    """The single line on standard error of a command that fails; nothing on standard output."""
    assert done.stdout == ""
    lines = done.stderr.splitlines()
    assert len(lines) == 1, done.stderr
    assert lines[0].startswith("quadcosim: ")
    return lines[0].removeprefix("quadcosim: ")


# -- help -------------------------------------------------------------------------------------------------


def test_help_lists_the_commands(main: Main) -> None:
    for flag in ("--help", "-h"):
        text = main(flag).stdout
        assert all(command in text for command in ("build", "run", "plot", "validate", "doctor"))


def test_without_a_command_the_help_is_shown_as_wrong_usage(main: Main) -> None:
    done = main(code=2)
    assert "Usage: quadcosim" in done.stdout + done.stderr


def test_help_of_run_lists_every_flag(main: Main, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "200")
    text = main("run", "--help").stdout
    flags = (
        "--period --offset --plant-interval --delay --delay-jitter --jitter --jitter-distribution --measurement-loss "
        "--command-loss --loss --burst-length --clock-ratio --noise --quantisation --order --hold --clock --preset "
        "--seed --stop-time --set --out --json --pause-at --resume"
    )
    assert [flag for flag in flags.split() if f"{flag} " not in text] == []


HEAVY = (
    "numpy",
    "matplotlib",
    "pandas",
    "pyarrow",
    "fmpy",
    "orchestration.foundation.basics.records",
    "orchestration.systems.system.model",
)


def test_help_loads_nothing_heavy() -> None:
    code = (
        "import json, sys\nfrom orchestration.command.cli import main\n"
        "for arguments in ['--help'], ['run', '--help']:\n"
        "    try:\n        main(arguments)\n    except SystemExit as end:\n        assert not end.code\n"
        f"print(json.dumps([name for name in {HEAVY!r} if name in sys.modules]))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.count("Usage") == 2
    assert json.loads(done.stdout.splitlines()[-1]) == []


# -- run --------------------------------------------------------------------------------------------------


def test_run_prints_all_metrics_as_json_and_nothing_else() -> None:
    done = quadcosim("run", *SHORT, "--json")
    printed = json.loads(done.stdout)
    assert printed.pop("verdict").endswith(", sampled every 10 ms")
    assert {**printed, "wall_time": None} == flown()


def test_run_prints_its_answer_and_every_metric_on_a_line(main: Main) -> None:
    answer, *lines = main("run", *SHORT).stdout.splitlines()
    assert re.fullmatch(r"bounded: ultimate_bound = \S+ m, expected < 0\.05 m, sampled every 10 ms", answer)
    assert {line.split()[0] for line in lines} == flown().keys() - {"divergence_time"}


def test_set_reaches_both_fmus(main: Main) -> None:
    for parameter in ("plant.mass=1.2", "controller.gain.eta=5"):
        printed = json.loads(main("run", "--json", *SHORT, "--set", parameter).stdout)
        assert printed["position_rmse"] != flown()["position_rmse"]


def test_the_fmus_are_those_that_are_named(main: Main, tmp_path: Path) -> None:
    plant = shutil.copy(fmus.locate("QuadrotorPlant"), tmp_path / "other.fmu")
    flown = [
        json.loads(main("run", "--stop-time", "0.1", "--json", "--plant", fmu).stdout)["position_rmse"]
        for fmu in (plant, "QuadrotorPlant", "native/QuadrotorPlant")
    ]
    assert flown[0] == flown[1]
    assert flown[2] == pytest.approx(flown[1], rel=1e-12)
    done = main("run", "--stop-time", "0.1", "--controller", plant, code=2)
    assert "controller" in done.stderr


def test_set_takes_whatever_a_path_of_a_system_can_be(main: Main) -> None:
    tank = EXAMPLES / "water_tank" / "system.toml"
    shown = main("show", tank, "--set", "connections.valve.hold=first", "--set", "seed=3").stdout
    assert "hold first" in shown
    given = {"connections.valve.hold=fist": "fist: expected one of zero, first", "seed=1.5": "expected a whole number"}
    for setting, text in given.items():
        assert text in error_line(main("run", tank, "--set", setting, code=2))


def test_the_seed_decides_the_random_numbers(main: Main) -> None:
    lossy = ("run", "--json", *SHORT, "--loss", "0.2", "--seed")
    first, again, other = (json.loads(main(*lossy, seed).stdout)["position_rmse"] for seed in ("1", "1", "2"))
    assert first == again != other


def test_flags_go_before_the_scenario_file(main: Main, here: Path) -> None:
    (here / "s.toml").write_text("stop_time = 0.2\n[timing]\nperiod = 0.02\ndelay = 0.004\n[plant]\nmass = 1.1\n")
    main("run", "s.toml", "--period", "0.01", "--out", "out", "--no-figures")
    scenario = load_run(here / "out").request
    assert isinstance(scenario, Scenario)
    assert (scenario.stop_time, scenario.timing) == (0.2, Timing(period=0.01, delay=0.004))
    assert scenario.plant.parameters == {"mass": 1.1}


@pytest.mark.usefixtures("blank_figures")
def test_out_keeps_the_run_and_its_figures(main: Main, here: Path) -> None:
    done = main("run", *SHORT, "--json", "--out", "results/first")
    printed = json.loads(done.stdout)
    assert printed.pop("verdict").startswith("bounded: ultimate_bound = 1.844 m")
    kept, notes = (
        json.loads((here / "results/first" / name).read_text()) for name in ("metrics.json", "provenance.json")
    )
    assert printed == {**kept, "wall_time": notes["wall_time"], "engine": notes["engine"]}
    assert "wall_time" not in kept, "of two equal flights the metrics are equal"
    names = {path.name for path in (here / "results/first").iterdir()}
    assert names >= {"signals.parquet", "events.parquet", "metrics.json", "scenario.toml", "commands.png", "path.png"}
    assert "results/first" in done.stderr.replace(os.sep, "/")


def test_plot_shows_that_it_is_at_work_before_it_looks_at_anything(
    main: Main, here: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    begun: list[str] = []

    def bar(what: str) -> Any:
        begun.append(what)
        return nullcontext(lambda share: None)

    monkeypatch.setattr(plotting, "progress_bar", bar)
    error_line(main("plot", "nowhere", code=2))
    assert begun == ["drawing"]


@in_test_all
def test_plot_draws_every_figure_unless_some_are_named(main: Main, here: Path) -> None:
    save_run(run(native(stop_time=0.5)), here / "run", figures=False)
    done = main("plot", "run", "--format", "png", "--size", "120x90")
    assert {Path(line).name for line in done.stdout.splitlines()} == {f"{name}.png" for name in FLIGHT}


def test_plot_zooms_on_a_window(main: Main, here: Path) -> None:
    save_run(run(native(stop_time=0.5)), here / "run", figures=False)
    small = ("--format", "png", "--size", "120x90")
    main("plot", "run", "--figure", "commands", *small)
    before = (here / "run" / "commands.png").read_bytes()
    done = main("plot", "run", "--figure", "commands", "--from", "0.1", "--to", "0.2", *small)
    assert [Path(line).name for line in done.stdout.splitlines()] == ["commands.png"]
    assert (here / "run" / "commands.png").read_bytes() != before
    done = main("plot", "run", "--figure", "schedule", *small)
    assert (done.stdout, done.stderr) == ("", "warning: --figure schedule: left out, as these runs have none\n")
    for start, end in (("0.2", "0.1"), ("50", "60"), ("0.5", "0.6"), ("-1", "0.1"), ("0.1", "inf"), ("nan", "0.1")):
        line = error_line(main("plot", "run", "--from", start, "--to", end, code=2))
        expected = "expected 0 <= from < to, and from before the end at 0.5 s"
        assert line == f"--from {float(start)} --to {float(end)}: {expected}"


@pytest.mark.skipif(sys.platform == "win32", reason="signals are another matter there")
@pytest.mark.parametrize(
    "out", sample([[], ["--out", "stopped", "--no-figures"]], 1), ids=lambda out: "kept" if out else "nothing kept"
)
def test_ctrl_c_ends_a_flight_with_one_line_and_130(here: Path, out: list[str]) -> None:
    code = "import signal; signal.signal(signal.SIGINT, signal.default_int_handler)\n" + (
        "from orchestration.foundation.basics import terminal; terminal.SPARSE = 0.0\n"  # reports when it runs
        "from orchestration.command.cli import main; main()"
    )
    with subprocess.Popen(
        [sys.executable, "-c", code, "run", "--stop-time", "1000", *out], stderr=subprocess.PIPE, text=True
    ) as process:
        assert process.stderr is not None
        while "running" not in process.stderr.readline():
            assert process.poll() is None
        process.send_signal(signal.SIGINT)
        lines = [line for line in process.stderr if not line.startswith("running")]
    assert process.returncode == 130
    assert len(lines) == 1
    assert lines[0].startswith("quadcosim: interrupted at t = ")
    if out:
        assert lines[0].endswith("; what was recorded is in stopped\n")
        assert load_run(here / "stopped").interrupted_at is not None
    else:
        assert list(here.iterdir()) == []


def test_divergence_is_a_result(main: Main) -> None:
    diverging = ("run", "--native", "--stop-time", "2", "--period", "0.3")
    done = main(*diverging)
    answer, *lines = done.stdout.splitlines()
    assert re.fullmatch(
        r"diverged: norm\(plant\.angular_velocity\) = \S+ at t = \S+ s, expected at most 1000, sampled every 300 ms",
        answer,
    )
    assert not any(line.endswith(" -") for line in lines)
    assert "Traceback" not in done.stderr
    printed = json.loads(main(*diverging, "--json").stdout)
    assert printed["diverged"] is True
    assert 0.0 < printed["divergence_time"] < 2.0


@pytest.mark.parametrize(
    ("parameters", "text", "time"),
    [
        (
            [f"plant.inertia.{axes}=1e-90" for axes in ("xx", "yy", "zz")],
            "plant.",
            0.001,
        ),
        (["controller.gain.translation.x=1e308"], "controller.", 0.0),
    ],
)
def test_an_fmu_that_reports_divergence_gives_a_result(
    parameters: list[str], text: str, time: float, main: Main
) -> None:
    flags = [flag for parameter in parameters for flag in ("--set", parameter)]
    done = main("run", *SHORT, *flags)
    assert f"diverged: {text}" in done.stdout
    assert "expected a finite value" in done.stdout
    assert f"divergence_time  {time:g} s" in done.stdout
    assert "Traceback" not in done.stderr


def test_a_run_paused_and_resumed_is_the_same_run(main: Main, here: Path) -> None:
    lossy = ("run", "--loss", "0.1", "--delay", "0.015", *SHORT)
    assert main(*lossy, "--pause-at", "0.2", "--out", "paused").stdout == ""
    resumed = main("run", "--resume", "paused", "--json", "--out", "whole", "--no-figures")
    assert json.loads(resumed.stdout)["steps"] == 500
    timing = Timing(measurement_loss=0.1, command_loss=0.1, delay=0.015)
    expected = run(native(stop_time=0.5, timing=timing))
    whole = load_run(here / "whole")
    assert whole.rows.tobytes() == expected.rows.tobytes()
    assert whole.events == expected.events


# -- errors -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (["--period", "-1"], "timing.period = -1.0: expected a positive number"),
        (["--jitter", "0.02"], "timing.jitter = 0.02: expected less than the period"),
        (["--delay", "late"], "--delay late: expected a number, or a table"),
        (["--period", "10ms"], "--period 10ms: expected a number without its unit; times are in seconds"),
        (["--burst-length", "3 losses"], "--burst-length 3 losses: expected a number without its unit (see --help)"),
        (["--delay", "1ms"], "--delay 1ms: expected a number without its unit, or a table of its distribution, as "),
        (["--delay", "{unifrm=[0,1]}"], "timing.delay.unifrm: no such key; expected one of uniform"),
        (["--loss", "2"], "timing.loss = 2.0: expected a probability"),
        (["--stop-time", "0"], "stop_time = 0.0: expected a positive number"),
        (["--seed", "-1"], "seed = -1: expected a whole number"),
        (["--noise", "position"], "--noise position: expected NAME=VALUE"),
        (["--noise", "position=much"], "--noise position = much: expected a number"),
        (["--noise", "position=-1"], "timing.noise of position = -1.0"),
        (["--quantisation", "mass=0.1"], "timing.quantisation: mass is no signal of it; expected one of position"),
        (["--set", "mass=1"], "mass: expected controller.NAME, plant.NAME, reference.NAME or disturbance.NAME"),
        (["--set", "plant.mass"], "--set plant.mass: expected NAME=VALUE"),
        (["--set", "plant.mass=heavy"], "plant.mass = heavy: expected a number"),
        (["--set", "plant.mas=1"], "did you mean mass?"),
        (["--step-size", "0.1"], "No such option: --step-size; did you mean --output-interval?"),
        (["--set", "controller.fmu="], "expected a parameter; set the FMU by --controller NAME|PATH"),
        (["--plant", "nowhere.fmu"], "plant.fmu"),
        (["--set", "controller.sample_period=0.1"], "controller.sample_period: expected --period and --clock instead"),
        (["--preset", "arducopter"], "preset arducopter: expected one of px4"),
        (["none.toml"], "none.toml: expected a readable system or scenario file"),
        (["its plant.fmu"], "its plant.fmu: expected a readable FMU: no such file"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else "",
)
def test_wrong_usage_is_one_line_and_code_2(main: Main, arguments: list[str], text: str) -> None:
    assert text in error_line(main("run", *SHORT, *arguments, code=2))


def test_the_script_itself_ends_with_2_for_wrong_usage() -> None:
    assert error_line(quadcosim("run", "--period", "-1", code=2)).startswith("timing.period = -1.0: expected")


def test_a_directory_that_is_no_run_is_wrong_usage(main: Main, here: Path) -> None:
    assert "expected the directory of a run" in error_line(main("plot", here, code=2))


def test_a_directory_of_something_else_is_not_overwritten(main: Main, here: Path) -> None:
    (here / "thesis").mkdir()
    (here / "thesis" / "thesis.tex").write_text("years of work")
    done = main("run", *SHORT, "--json", "--out", "thesis", code=2)
    assert "expected a new or empty directory" in error_line(done)  # before the flight
    assert [path.name for path in (here / "thesis").iterdir()] == ["thesis.tex"]


@pytest.mark.parametrize("arguments", [["run", "--perido", "1"], ["fly"], ["run", "--period", "fast"], ["plot"]])
def test_what_the_command_line_does_not_know_is_code_2(main: Main, arguments: list[str]) -> None:
    done = main(*arguments, code=2)
    assert len(done.stderr.splitlines()) == 1
    assert done.stderr.startswith("quadcosim: ")


@pytest.mark.parametrize(
    ("parameter", "line"),
    [
        ("plant.mass=0", "plant.mass = 0.0: expected a finite value > 0"),
        ("plant.external_force.x=nan", "plant.external_force.x = nan: expected a finite number"),
        ("controller.boundary_layer=0", "controller.boundary_layer = 0.0: expected a finite value > 0"),
        (
            "plant.inertia.xy=5",
            "plant.inertia.{xx,yy,zz,xy,xz,yz} = xx 1, yy 1, zz 1, xy 5, xz 0, yz 0: "
            "expected a positive definite matrix",
        ),
    ],
)
def test_a_value_that_an_fmu_refuses_is_wrong_usage_in_its_own_words(main: Main, parameter: str, line: str) -> None:
    assert error_line(main("run", *SHORT, "--set", parameter, code=2)) == line


def test_an_fmu_on_the_wrong_side_is_refused_with_what_it_lacks(main: Main, here: Path) -> None:
    (here / "s.toml").write_text('[plant]\nfmu = "UnifiedController"')
    line = error_line(main("run", "s.toml", code=2))
    assert line.startswith("plant.fmu: UnifiedController has no output position.x, position.y, ")
    assert "; its outputs are thrust, torque.x, " in line
    (here / "s.toml").write_text('[controller]\nfmu = "QuadrotorPlant"')
    line = error_line(main("run", "s.toml", code=2))
    assert line.startswith("controller.fmu: QuadrotorPlant has no input position.x, position.y, ")


@pytest.mark.parametrize("command", ["run", "ssp"])
def test_what_is_no_zip_is_no_fmu(main: Main, here: Path, command: str) -> None:
    (here / "no.fmu").write_text("hello")
    (here / "s.toml").write_text('[plant]\nfmu = "no.fmu"')
    assert error_line(main(command, "s.toml", code=2)) == "no.fmu: expected an FMU, which is a zip file"


@pytest.mark.parametrize(
    ("flags", "warning"),
    [
        (["--period", "5"], "timing.period = 5.0: the run ends at 0.5 s, so controller samples only once"),
        (["--offset", "5"], "timing.offset = 5.0: the run ends at 0.5 s, so controller never samples"),
        (["--delay", "5"], "timing.delay = 5.0: the run ends at 0.5 s, so none of its messages arrives"),
    ],
)
def test_a_timing_that_the_run_is_too_short_for_is_warned_of(main: Main, flags: list[str], warning: str) -> None:
    told = f"warning: {warning} (times are in seconds: 5 ms is 0.005)"
    assert told in main("run", *SHORT, "--json", *flags).stderr.splitlines()
    assert "warning" not in main("run", *SHORT, "--json", flags[0], "0.01").stderr


@pytest.mark.parametrize(
    ("parameter", "code", "text"),
    [("plant.mas=1", 2, "UsageError"), ("plant.mass=0", 2, "in the FMU:")],
)
def test_debug_shows_where(main: Main, parameter: str, code: int, text: str) -> None:
    for arguments in (("--debug", "run", "--set", parameter), ("run", "--set", parameter, "--debug")):
        done = main(*arguments, "--stop-time", "0.5", code=code)
        assert "Traceback (most recent call last)" in done.stderr
        assert text in done.stderr
        assert done.stderr.splitlines()[-1].startswith("quadcosim: ")


# -- build and validate -----------------------------------------------------------------------------------


def test_build_writes_all_fmus_where_it_is_reported(here: Path, main: Main) -> None:
    done = main("build", "--out", "mine")
    assert {Path(line).resolve() for line in done.stdout.splitlines()} == {
        here.resolve() / "mine" / f"{model}.fmu" for model in MODELS
    }
    assert len(list((here / "mine").iterdir())) == len(MODELS)


def test_validate_finds_nothing_wrong_with_an_fmu(built: dict[str, Path], main: Main) -> None:
    assert main("validate", built["QuadrotorPlant"]).stdout.count(": no problems found") == 1


def test_validate_takes_all_fmus_of_the_project_by_default(main: Main) -> None:
    done = main("validate", "--time-limit", "0.001", code=1)  # that of a process each: it finds that it is too short
    assert all(f"{model}.fmu" in done.stdout for model in MODELS)


def damaged(fmu: Path, path: Path) -> Path:
    """A copy whose description gives a variable a causality that there is none of."""
    with zipfile.ZipFile(fmu) as source, zipfile.ZipFile(path, "w") as copy:
        for name in source.namelist():
            content = source.read(name)
            if name == "modelDescription.xml":
                assert b'causality="output"' in content
                content = content.replace(b'causality="output"', b'causality="result"')
            copy.writestr(name, content)
    return path


@in_test_all
def test_validate_ends_with_1_for_a_damaged_fmu(built: dict[str, Path], here: Path, main: Main) -> None:
    done = main("validate", damaged(built["QuadrotorPlant"], here / "damaged.fmu"), code=1)
    assert "damaged.fmu" in done.stdout + done.stderr
    assert "Traceback" not in done.stderr


def test_validate_of_what_is_not_there_is_wrong_usage(main: Main) -> None:
    assert error_line(main("validate", "none.fmu", code=2)) == "none.fmu: no such file"


# -- a project of its own ---------------------------------------------------------------------------------


@pytest.fixture
def project(here: Path) -> Path:
    """A copy of the sources in which no FMU has been built."""
    copy = here / "project"
    for package in ("fmu_kit", "controller_fmu", "plant_fmu", "orchestration"):
        shutil.copytree(ROOT / package, copy / package)
    shutil.copy(ROOT / "pyproject.toml", copy)
    (copy / "fmus").mkdir()
    return copy


@in_test_all
def test_fmus_are_built_into_the_project_when_they_are_missing_or_old(project: Path) -> None:
    def run() -> list[str]:
        done = subprocess.run(
            [sys.executable, "-m", "orchestration.command.cli", "run", "--stop-time", "0.05", "--json"],
            cwd=project, env={**os.environ, "PYTHONPATH": str(project)}, capture_output=True, text=True, check=True,
        )  # fmt: skip
        assert json.loads(done.stdout)["steps"] == 50
        others = (
            "running:",
            "building:",
            "follows ",
        )  # how far it is where it takes long; .05 s do not settle
        return [line for line in done.stderr.splitlines() if not line.startswith(others)]

    assert [line.split()[0] for line in run()] == ["building", "building"]
    assert {path.name for path in (project / "fmus").iterdir()} == {"QuadrotorPlant.fmu", "UnifiedController.fmu"}
    assert run() == []
    with (project / "plant_fmu" / "wind.py").open("a", encoding="utf-8") as source:
        source.write("# changed\n")
    os.utime(project / "plant_fmu" / "wind.py", (0, 0))  # as after a clone, the FMU is the younger file
    (line,) = run()
    assert line.startswith("building")
    assert "QuadrotorPlant" in line


@pytest.mark.skipif(sys.platform != "linux", reason="other systems have no such names")
def test_a_folder_whose_name_is_no_text_is_named_and_nothing_else_is_blamed(
    built: dict[str, Path], tmp_path: Path
) -> None:
    folder = tmp_path / os.fsdecode(b"caf\xe9")
    folder.mkdir()
    (folder / "it.fmu").write_bytes(built["QuadrotorPlant"].read_bytes())
    (folder / "system.toml").write_text('stop_time = 0.01\n[components.it]\nfmu = "it.fmu"\nstep = 0.01\n')
    for arguments in (("run", "system.toml"), ("run", "--stop-time", "0.01", "--out", folder / "kept")):
        done = subprocess.run(
            subprocesses.command("orchestration.command.cli", *arguments), cwd=folder, capture_output=True, check=False,
            env=subprocesses.environment(),
        )  # fmt: skip
        (line,) = done.stderr.decode().splitlines()
        assert done.returncode == 2
        assert line.startswith("quadcosim: ")
        assert "caf\\udce9" in line
        assert line.endswith(": expected names of files and folders in UTF-8")


def test_a_run_of_which_nothing_is_kept_holds_what_its_expressions_use_alone(
    main: Main, monkeypatch: pytest.MonkeyPatch
) -> None:
    held: list[tuple[str, ...]] = []
    begin = InMemory.begin

    def noted(self: InMemory, columns: tuple[str, ...]) -> None:
        begin(self, columns)
        held.append(self.columns)

    monkeypatch.setattr(InMemory, "begin", noted)
    found = json.loads(main("run", *SHORT, "--json").stdout)
    kept = run(native(stop_time=0.5))
    columns = held[0]
    assert {"time", "plant.torque.x"} < {*columns} < {*kept.columns}
    assert "plant.acceleration.x" not in columns
    assert {name: found[name] for name in kept.metrics} == kept.metrics
