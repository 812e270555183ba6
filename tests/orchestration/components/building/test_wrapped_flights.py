"""Controllers in C fly as any other: limits, lanes, exported laws wrapped again, and what `new --c` writes."""

import contextlib
import json
import re
import sqlite3
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fmu_kit.bundle import Target
from orchestration.components.building import builder
from orchestration.components.building.models import CONTROLLERS, MODELS
from orchestration.components.fmi.read_description import read_model
from orchestration.components.fmi.reuse import Instances
from orchestration.components.scaffold.folder import write
from orchestration.experiments.live.live import live
from orchestration.experiments.studies.sweep import sweep
from orchestration.foundation.basics.documents import read_toml
from orchestration.quadrotor.flight.hover import hover_of
from orchestration.quadrotor.flight.hover_loop import controller_at_hover, located
from orchestration.simulation.requests.one_fmu import alone
from orchestration.simulation.runs.pause import fly_until, resume
from orchestration.simulation.runs.simulation import run
from orchestration.systems.system.model import Criterion
from quadcosim import FmuChoice, Scenario, UsageError, bode, changed, linearise, load_study, load_system, margin
from tests.commands import Main
from tests.extent import in_test_all, sample
from tests.orchestration.components.building.test_wrap import PD, PD_C, PD_H
from tests.places import ROOT

LAWS = sample([*CONTROLLERS], 1)
EXAMPLE = ROOT / "examples" / "double_integrator"


@pytest.fixture(scope="module")
def integrator(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The system file of the double integrator under a PD in C."""
    folder = tmp_path_factory.mktemp("integrator")
    text = (EXAMPLE / "system.toml").read_text().replace("StateFeedback.fmu", "pd.toml")
    files = {"pd.c": PD_C, "pd.h": PD_H, "pd.toml": PD, "system.toml": text}
    for name, content in {**files, "plant.py": (EXAMPLE / "plant.py").read_text()}.items():
        (folder / name).write_text(content)
    return folder / "system.toml"


def test_its_local_limit_on_the_double_integrator_is_that_of_the_law(integrator: Path, main: Main) -> None:
    period = "components.controller.sampling.period"
    asked = ("--of", period, "--from", "1.9", "--to", "2.1", "--scan", "0.1", "--json", "--build", "--no-figures")
    found = main("limit", integrator, *asked)
    assert json.loads(found.stdout)["local_limit"] == pytest.approx(2.0, abs=1e-3)
    assert "its code believes 0.05 s; at other periods this is the limit of that code" in found.stdout


def test_theory_and_a_tuning_at_another_period_warn_in_the_words_of_a_run(
    integrator: Path, main: Main, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    told = (
        "controller (Pd): is sampled every 0.1 s, but its code believes 0.05 s: what it computes of time is wrong by a "
        "factor of 2"
    )
    gain = "components.controller.parameters.k_p"
    slow = ("--set", "components.controller.sampling.period=0.1", "--set", "stop_time=10")
    noisy, jitter = integrator.with_name("hit.toml"), "connections.command.delay_jitter"
    noisy.write_text(integrator.read_text().replace("[criterion]", 'square = "mean(plant.x ** 2)"\n[criterion]'))
    between = (gain, "--from", "0.9", "--to", "1.1")
    for command in (
        ["expect"], ["bode"], ["step"], ["locus", "--of", *between, "--count", "2"],
        ["margin", "--of", jitter, "--to", "0.01"],
    ):  # fmt: skip
        name, *others = command
        assert main(name, noisy, *others, *slow, "--build").stderr.count(f"warning: {told}\n") == 1, name
    assert not main("expect", noisy, "--build").stderr
    limited = main("limit", noisy, "--of", *between, "--scan", "0.1", *slow, "--json", "--build", "--no-figures")
    assert json.loads(limited.stdout)["notes"].count(told) == 1
    tuning = tmp_path / "gains.toml"
    tuning.write_text(
        f'scenario = "{noisy.as_posix()}"\n[cost]\nof = "square"\nby = "expect"\n[search]\nperiods = [0.05, 0.1]\n'
        f'evaluations = 1\nseeds = [1]\n[[parameters]]\nname = "k_p"\nsets = ["{gain}"]\nstart = 0.9\nstop = 1.1\n'
    )
    out = tmp_path / "out"
    assert main("tune", tuning, "--out", out, "--build").stderr.count(f"warning: {told}\n") == 1
    assert f"\n# {told}\n" in (out / "gains_100ms.toml").read_text()
    assert "believes" not in (out / "gains_50ms.toml").read_text()


def test_theory_asks_its_fmu_for_what_it_computes(integrator: Path, main: Main) -> None:
    text = integrator.read_text().replace('"controller.v"]', '"controller.v"]\nnoise = 0.01')
    noisy = integrator.with_name("noisy.toml")
    noisy.write_text(text.replace("[criterion]", 'rms = "rms(plant.x)"\n[criterion]'))
    expected = json.loads(main("expect", noisy, "--json", "--build").stdout)
    assert expected["mean_square_radius"] == pytest.approx(1.0 - 0.05 + 0.05**2 / 2.0, abs=1e-9)  # the determinant
    asked = ("--of", "connections.command.delay_jitter", "--json", "--build", "--out", integrator.parent / "proof.json")
    assert json.loads(main("margin", integrator, *asked).stdout)["certified"] == pytest.approx(0.05)


def test_a_run_at_another_period_warns_and_at_its_own_does_not(integrator: Path) -> None:
    system = load_system(integrator)
    assert run(changed(system, {"stop_time": 1.0})).warnings == ()
    slow = changed(system, {"stop_time": 1.0, "components.controller.sampling.period": 0.2})
    assert run(slow).warnings == (
        "controller (Pd): is sampled every 0.2 s, but its code believes 0.05 s: what it computes of time is wrong by "
        "a factor of 4",
    )
    (told,) = run(alone(integrator.with_name("Pd.fmu"), interval=0.2, stop_time=1.0)).warnings
    assert told.startswith("Pd (Pd): is sampled every 0.2 s, but its code believes 0.05 s")


def test_a_verdict_names_the_time_and_the_output_that_is_not_finite(integrator: Path) -> None:
    gains = {f"components.controller.parameters.k_{each}": 1e308 for each in "pd"}
    system = replace(changed(load_system(integrator), gains), criterion=Criterion(diverged="abs(plant.x) > 1e307"))
    (told,) = {run(system, engine=each).divergence for each in ("python", "compiled")}
    assert told == "controller.u = inf: expected a finite value, at t = 0.05 s"


def test_a_page_refuses_it_before_anything_is_compiled(integrator: Path) -> None:
    with pytest.raises(UsageError, match=r"^components\.controller: its C is compiled for this machine, and does not"):
        live(load_system(integrator))


def test_a_task_of_a_computer_at_another_period_warns(integrator: Path) -> None:
    task = '[computers.node.tasks.control]\ncomponent = "controller"\nperiod = 0.2\n'
    text = integrator.read_text().replace("sampling = { period = 0.05 }\n", "")
    placed = integrator.with_name("placed.toml")
    placed.write_text(f"{text}\n{task}")
    system = changed(load_system(placed), {"stop_time": 1.0})
    (told,) = run(system).warnings
    assert told.startswith("controller (Pd): is sampled every 0.2 s, but its code believes 0.05 s")
    assert "missed" not in run(system).verdict
    late = [
        run(changed(system, {"computers.node.tasks.control.execution": taken})).verdict.partition("; deadlines ")[2]
        for taken in (0.3, 2.0)
    ]
    assert late == ["missed: node.control 5", "missed: node.control 5 (never done)"]


IN_TWO = """\
name = "Pd"
{period}sources = ["parts.c"]
declare = "extern double x, v, u; void position_step(void); void speed_step(void);"
{steps}
[inputs]
x = {{ c = "x", unit = "m" }}
v = {{ c = "v", unit = "m/s" }}
[outputs]
u = {{ c = "u", unit = "m/s2" }}
"""
PARTS_C = """\
double x, v, u;
static double wanted;
void position_step(void) { wanted = -x; }
void speed_step(void) { static int calls; calls++; u = wanted - v + 0 * calls; }
"""
ONE_STEP = 'step = "position_step(); speed_step();"'
TWO_TASKS = "".join(
    f'[[tasks]]\nname = "{n}_task"\nperiod = 0.05\nstep = "{n}_step();"\n' for n in ("position", "speed")
)


@pytest.fixture(scope="module")
def parts(integrator: Path) -> Path:
    """The folder of a PD in two parts: in one step, and as two tasks, with the system of these."""
    folder = integrator.parent
    (folder / "parts.c").write_text(PARTS_C)
    (folder / "one.toml").write_text(IN_TWO.format(period="period = 0.05\n", steps=ONE_STEP))
    (folder / "two.toml").write_text(IN_TWO.format(period="", steps=TWO_TASKS))
    text = integrator.read_text().replace("stop_time = 240.0", "stop_time = 12.0")
    (folder / "one_step.toml").write_text(text.replace("pd.toml", "one.toml"))
    begin, end = text.index("[components.controller]"), text.index("[objectives]")
    lines = [f'[components.{n}]\nfmu = "two.toml"\npartition = "{n}_task"\n' for n in ("position", "speed")]
    for name, start, to in (
        ("a", "plant.x", "position.x"),
        ("b", "plant.v", "speed.v"),
        ("command", "speed.u", "plant.u"),
    ):
        lines.append(f'[[connections]]\nname = "{name}"\nfrom = ["{start}"]\nto = ["{to}"]\n')
    (folder / "two_tasks.toml").write_text(text[:begin] + "\n".join(lines) + text[end:])
    return folder


def onboard(folder: Path, execution: float) -> Path:
    """The system of two tasks, on a computer on which each takes as long as that."""
    tasks = "".join(
        f"[computers.cpu.tasks.{n}]\ncomponent = '{n}'\nperiod = 0.05\nexecution = {execution}\npriority = {i}\n"
        for i, n in enumerate(("position", "speed"))
    )
    file = folder / f"onboard_{execution}.toml"
    file.write_text(f"{(folder / 'two_tasks.toml').read_text()}\n{tasks}")
    return file


def test_tasks_of_one_period_are_their_statements_in_one_step(parts: Path) -> None:
    whole = run(load_system(parts / "one_step.toml"), in_process=True)
    assert abs(whole.signals["plant.x"][-1]) < 0.01
    for file in (parts / "two_tasks.toml", onboard(parts, 0.0)):
        for engine in ("python", "compiled"):
            both = run(load_system(file), engine=engine, in_process=True)
            for mine, name in (("controller.u", "speed.u"), ("plant.x", "plant.x"), ("plant.v", "plant.v")):
                assert both.signals[name].tobytes() == whole.signals[mine].tobytes()
            assert both.warnings == ()
    assert read_model(parts / "fmi3" / "Pd.fmu").saves_state
    text = (parts / "one_step.toml").read_text().replace("one.toml", "fmi3/Pd.fmu")
    for sampling in ('fmu_clock = "speed_task"', "period = 0.05"):  # the clocks of both tick, or all that is due runs
        (parts / "alone.toml").write_text(text.replace("period = 0.05", sampling))
        alone = run(load_system(parts / "alone.toml"), in_process=True)
        assert alone.rows.tobytes() == whole.rows.tobytes()


def test_tasks_are_paused_whole_and_have_limits(parts: Path, main: Main) -> None:
    file = onboard(parts, 0.01)
    whole = run(load_system(file), in_process=True)
    assert fly_until(load_system(file), 3.015, parts / "paused", in_process=True) is None  # between the two jobs
    assert resume(parts / "paused", in_process=True).rows.tobytes() == whole.rows.tobytes()
    (told,) = run(changed(load_system(parts / "two_tasks.toml"), {"components.speed.sampling.period": 0.1})).warnings
    assert told.startswith("speed (Pd): is sampled every 0.1 s, but its code believes 0.05 s")
    asked = ("--of", "connections.command.delay", "--from", "0.6", "--to", "0.8", "--scan", "0.1", "--json", "--build")
    found = json.loads(main("limit", parts / "two_tasks.toml", *asked, "--tolerance", "0.02", "--no-figures").stdout)
    assert (found["large_signal_limit"], found["local_limit"]) == pytest.approx((0.686137, 0.686137), abs=0.02)


def test_a_loop_of_code_of_two_rates_has_the_poles_and_margins_of_a_map_made_by_hand(parts: Path) -> None:
    """The speed every 0.05 s, then the position every 0.25 s: five samples are a period, which begins with a state."""
    tasks = TWO_TASKS.replace('"position_task"\nperiod = 0.05', '"position_task"\nperiod = 0.25')
    tasks = "".join(f"[[tasks]]{task}" for task in reversed(tasks.split("[[tasks]]")[1:]))
    (parts / "rates.toml").write_text(IN_TWO.format(period="", steps=tasks))
    file = parts / "rates_system.toml"
    file.write_text((parts / "one_step.toml").read_text().replace("one.toml", "rates.toml"))

    def by_hand(factor: complex, late: int = 0) -> np.ndarray:
        """Of x, v, what the position task wants, and commands on the way, over a period, with a factor on commands."""
        whole, h = np.eye(3 + late, dtype=complex), 0.05
        for k in range(5):
            sent = np.vstack([whole[3:], factor * (whole[2] - whole[1])])
            x, v, u = whole[0], whole[1], sent[0]
            wanted = -x if k == 0 else whole[2]
            whole = np.vstack([x + h * v + 0.5 * h * h * u, v + h * u, wanted, sent[1:]])
        return whole

    def radius(factor: complex, late: int = 0) -> float:
        return float(np.abs(np.linalg.eigvals(by_hand(factor, late))).max())

    system = load_system(file)
    found = bode(system, "controller")
    (loop,) = found.loops
    assert (found.dt, found.samples, found.radius) == (0.05, 5, pytest.approx(radius(1.0), abs=1e-9))
    assert loop.gain_margin is not None
    assert loop.phase_margin is not None
    assert radius(loop.gain_margin) == pytest.approx(1.0, abs=1e-6)
    turned = np.exp(-1j * np.radians(loop.phase_margin))
    assert radius(turned) == pytest.approx(1.0, abs=1e-6)
    assert min(np.abs(np.angle(np.linalg.eigvals(by_hand(turned))) - 0.25 * loop.crossover)) < 1e-6
    late = int(loop.delay_margin / 0.05)
    assert radius(1.0, late) < 1.0 < radius(1.0, late + 1)
    between = changed(system, {"components.controller.sampling.period": 0.0500000005})  # steps of two lengths
    assert linearise(between).radius == pytest.approx(radius(1.0), abs=1e-6)
    with pytest.raises(UsageError, match="controller: responds alike only at every 5th sample, as code of several"):
        margin(system, "connections.command.delay_jitter")


def bits(path: Path) -> list[tuple[Any, ...]]:
    """What is stored of each run, but for how long it took and by which engine."""
    with contextlib.closing(sqlite3.connect(path)) as store:
        columns = "middle, late, outcome, divergence_time, steps"
        return store.execute(f"SELECT {columns} FROM runs ORDER BY 1, 2, 3, 4").fetchall()


def test_in_lanes_it_has_the_bits_of_its_runs_one_by_one(integrator: Path) -> None:
    folder = integrator.parent
    (folder / "study.toml").write_text("""
scenario = "system.toml"
[[axes]]
name = "T"
sets = ["components.controller.sampling.period"]
values = [0.05, 0.3, 1.9, 2.1]
[[axes]]
name = "k"
sets = ["components.controller.parameters.k_p"]
values = [0.5, 1.0, 1.5]
""")
    study = load_study(folder / "study.toml")
    lanes = sweep(study, out=folder / "lanes", engine="batch")
    singly = sweep(study, out=folder / "singly", engine="compiled")
    assert (lanes.engine, singly.engine, lanes.failed) == ("batch", "compiled", 0)
    assert bits(lanes.path) == bits(singly.path)


@pytest.fixture(scope="module")
def exported(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of laws as `export-c` writes them."""
    folder = tmp_path_factory.mktemp("exported")
    builder.export_c([Target.parse(MODELS[name]) for name in LAWS], folder)
    return folder


def wrapped(name: str, folder: Path) -> Path:
    """A law that `export-c` has written, wrapped again: its variables are those that its header names."""
    tables: dict[str, list[str]] = {"in": [], "out": [], "par": []}
    table = None
    for line in (folder / f"{name}.h").read_text().splitlines():
        found = re.match(r" {8}double (\w+); +/\* ([\w.]+)(?: \[(.*?)\])?:", line)
        if found and table is None:
            table = "in"
        if found and table in tables:
            unit = f', unit = "{found[3]}"' if found[3] else ""
            tables[table].append(f'"{found[2]}" = {{ c = "law.{table}.{found[1]}"{unit} }}')
        if closed := re.match(r"    } (\w+);", line):
            table = {"in": "out", "out": "par", "par": "local"}.get(closed[1], "local")
    lines = [
        f'name = "Wrapped{name}"',
        "period = 0.01",
        f'sources = ["{name}.c"]',
        f'headers = ["{name}.h"]',
        f'declare = "static {name} law; static long long tick;"',
        f'init = "{name}_init(&law);"',
        f'after_parameters = "{name}_start(&law, 0.0);"',
        f'step = "{name}_step(&law, (double)(10000000 * tick) / 1e9, 0.01); tick++;"',
    ]
    for key, own in (("inputs", "in"), ("outputs", "out"), ("parameters", "par")):
        lines += [f"[{key}]", *tables[own]]
    (folder / f"{name}.toml").write_text("\n".join(lines))
    return folder / f"{name}.toml"


@in_test_all
@pytest.mark.parametrize("name", LAWS)
def test_a_law_exported_to_c_and_wrapped_again_flies_the_same_bits(name: str, exported: Path) -> None:
    flight = Scenario(stop_time=0.5, plant=FmuChoice(fmu="native/QuadrotorPlant"))
    one = run(flight.with_changes(controller=FmuChoice(fmu=f"native/{name}")))
    other = run(flight.with_changes(controller=FmuChoice(fmu=str(wrapped(name, exported)))))
    exchanged = [column for column in one.columns if column.startswith("plant.") or column == "time"]
    assert len(exchanged) > 15
    differing = [  # before its first step it has what start leaves
        name for name in exchanged if one.signals[name][1:].tobytes() != other.signals[name][1:].tobytes()
    ]
    assert differing == []
    assert np.ptp(one.signals["plant.position.x"]) > 0.01


def test_a_crash_in_the_c_is_one_line_with_its_signal_and_its_place(integrator: Path, main: Main) -> None:
    file, step = integrator.with_name("pd.toml"), "pd_step(&in, &out);"
    file.with_name("bad.c").write_text("int pd_n;\n\nvoid pd_bad(volatile int *to)\n{\n    *to = pd_n;\n}\n")
    changes = {
        "extern void pd_bad(volatile int *); if (n++ == 3) pd_bad(0);": ("SIGSEGV", "bad.c:5 (pd_bad)"),
        "static char *none; if (n++ == 3) { __builtin_memcpy(none, &n, 99999); n = 0; }": ("SIGSEGV", "bad.toml:8"),
        "static void (*none)(void); if (n++ == 3) { none(); n = 0; }": ("SIGSEGV", "bad.toml:8"),
        "static volatile int none; if (n++ == 3) n /= none;": ("SIGFPE", "bad.toml:8 (integer division by zero)"),
        "static struct { int of[3]; } all; all.of[n++] = 1;": (
            "SIGILL",
            "bad.toml:9 (index, overflow, division, shift or conversion that C leaves undefined)",
        ),
        "static volatile int k; if (n++ == 3) for (;;) k = !k;": (
            "it takes more than the time limit of 1 s",
            "bad.toml:8",
        ),
    }
    ways = "".join(f"if (pd_kp == {k}) {{ {change} }} " for k, change in enumerate(changes, 2))  # all in one FMU
    text = file.read_text().replace(step, f"static int n; {ways}{step}").replace('"pd.c"', '"pd.c", "bad.c"')
    for k, (died, place) in enumerate(changes.values(), 2):
        checked = '"Bad"\nsanitize = true' if died == "SIGILL" else '"Bad"'
        file.with_name("bad.toml").write_text(text.replace('"Pd"', checked))
        system = integrator.with_name("bad_system.toml")
        system.write_text(integrator.read_text().replace("pd.toml", "bad.toml"))
        limited = ("--time-limit", "1") if "time limit" in died else ()
        done = main("run", system, "--build", "--set", f"components.controller.parameters.k_p={k}", *limited, code=1)
        (line,) = [line for line in done.stderr.splitlines() if line.startswith("quadcosim:")]
        assert f"{died}, in a call of controller (Bad), at {place}, after t = " in line
    overrun = "static int n; static struct { int of[3]; } all; all.of[n++] = 1;"
    file.with_name("bad.toml").write_text(file.read_text().replace('"Pd"', '"Bad"').replace(step, f"{overrun} {step}"))
    checked = main("validate", file.with_name("bad.toml"), code=1).stdout  # made with checks, though the file has none
    assert "process: the process of the FMU ended by SIGILL in " in checked
    assert "at bad.toml:8 (index, overflow, " in checked


@pytest.fixture(scope="module")
def hover(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The file of the controller that `new --c` writes."""
    folder = tmp_path_factory.mktemp("new")
    write("controller", "hover_c", folder, author='A "quoted" name', license="MIT", in_c=True)
    return folder / "hover_c" / "hover_c.toml"


def test_what_new_writes_in_c_passes_its_tests_and_flies_a_vehicle(hover: Path) -> None:
    own = hover.with_name("test_hover_c.py")
    renamed, one = hover.with_name("test_renamed.py"), re.findall(r"def (test_\w*nose\w*)", own.read_text())[0]
    renamed.write_text(own.read_text().replace('"hover_c_step"', '"hover_c_outer"'))
    done = subprocess.run(
        [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", str(own), f"{renamed}::{one}"],
        cwd=hover.parents[1], capture_output=True, text=True, check=False,
    )  # fmt: skip
    told = [line for line in done.stdout.splitlines() if line.startswith(("FAILED", "ERROR"))]
    assert [one in line for line in told] == [True], done.stdout + done.stderr
    assert "6 passed" in done.stdout.splitlines()[-1]
    assert "hover_c.c has no hover_c_outer: in after_step, call what hover_c.toml calls now" in done.stdout
    mine = FmuChoice(fmu=str(hover))
    result = run(Scenario(stop_time=0.3, controller=mine, plant=FmuChoice(fmu="native/QuadrotorPlant")))
    assert not result.metrics["diverged"]


def test_its_delay_limit_by_theory_comes_from_the_process_of_its_fmu_and_is_that_of_floats(
    hover: Path, main: Main, tmp_path: Path
) -> None:
    for path in hover.parent.glob("hover_c.[cht]*"):
        (tmp_path / path.name).write_text(path.read_text().replace("double", "float"))
    floats = tmp_path / hover.name
    flight = ("--controller", floats, "--reference", "hover", "--stop-time", "0.5", "--build")
    asked = ("--of", "delay", "--from", "0", "--to", "0.1", "--scan", "0.1", "--tolerance", "0.1", "--no-figures")
    found = json.loads(main("limit", *flight, *asked, "--json").stdout)
    assert found["local_limit"] == pytest.approx(0.0635, abs=2e-4)
    assert found["local_method"].endswith(", float code of controller in double precision")
    _, feedback = controller_at_hover(located(hover_of(Scenario(controller=FmuChoice(fmu=str(floats))))), Instances())
    assert feedback[0] == pytest.approx([0.0, 0.0, 4.0, 0.0, 0.0, 3.5, *[0.0] * 6], abs=1e-6)  # 9.81 N, and two gains


BASE = """
[base]
stop_time = 0.5
controller = { fmu = "hover_c/hover_c.toml" }
plant = { fmu = "native/QuadrotorPlant" }
"""


def test_it_is_compared_and_tuned_in_lanes_over_its_parameters(hover: Path, main: Main) -> None:
    folder = hover.parents[1]
    names = "".join(f'[[controllers]]\nname = "{k}"\nparameters = {{ k_p = {k} }}\n' for k in (2.0, 4.0))
    axis = '[axis]\nname = "delay"\nsets = ["timing.delay"]\nvalues = [0.0, 0.05]\n'
    (folder / "both.toml").write_text(f'name = "both"\n{BASE}\n{names}{axis}[starts]\ncount = 2\n')
    told = main("compare", folder / "both.toml", "--out", folder / "both", "--no-figures", "--build")
    assert "engine batch" in told.stderr
    assert "8 runs, 8 of them new" in told.stderr
    tuned = "".join(
        f'[[parameters]]\nname = "{name}"\nsets = ["controller.{name}"]\nstart = 1.0\nstop = 8.0\n'
        for name in ("k_p", "k_d")
    )
    search = '[cost]\nof = "position_rmse"\nbad = 10.0\n[search]\nperiods = [0.01]\nevaluations = 2\nseeds = [1]\n'
    starts = "[starts]\ncount = 2\njudged = 2\n"
    (folder / "mine.toml").write_text(f'name = "mine"\n{BASE}\n{search}{starts}{tuned}')
    assert "engine batch" in main("tune", folder / "mine.toml", "--out", folder, "--build").stderr
    gains = read_toml(folder / "mine_10ms.toml", "gains")["controller"]
    assert all(1.0 <= gains[name] <= 8.0 for name in ("k_p", "k_d"))
