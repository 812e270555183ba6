"""What `quadcosim new` writes works as it stands: it is packed, flown, tested, and has a limit."""

import json
import subprocess
import sys
import zipfile
from pathlib import Path
from xml.etree.ElementTree import fromstring

import numpy as np
import pytest

from orchestration.components.building import builder, fmus
from orchestration.components.scaffold.folder import Kind, class_name, module_name, write
from orchestration.experiments.limits import limit
from orchestration.foundation.basics.bisection import Range
from orchestration.foundation.basics.errors import UsageError
from orchestration.simulation.requests.ranges import Varied
from orchestration.simulation.runs.simulation import run
from orchestration.systems.system.file import load_system
from orchestration.systems.system.model import System
from orchestration.systems.system.paths import changed
from orchestration.theory.stability.linearise import linearise
from orchestration.theory.stability.local_limit import LOOP, local_limits
from quadcosim import bode, expect, margin
from tests.commands import Main
from tests.extent import in_test_all, sample

LIMITS = {
    "pendulum": ("components.controller.sampling.period", 0.1, 0.3),
    "low_pass": ("components.filter.parameters.time_constant", 0.05, 0.4),
}
KINDS: dict[str, Kind] = {"pendulum": "plant", "low_pass": "filter"}


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_five_commands_lead_to_the_limit_plot_of_ones_own_controller(here: Path, main: Main) -> None:
    made = main("new", "controller", "hover_pd", "--author", 'Ada "A." Lovelace', "--license", "Apache-2.0")
    assert made.stdout.split() == [
        "hover_pd/hover_pd.py", "hover_pd/test_hover_pd.py", "hover_pd/system.toml", "hover_pd/README.md",
    ]  # fmt: skip
    built = Path("hover_pd", "native", "HoverPd.fmu")
    assert main("build", "hover_pd", "--native").stdout.splitlines() == [str(built.resolve())]
    with zipfile.ZipFile(built) as archive:
        said = fromstring(archive.read("modelDescription.xml")).attrib
        page = archive.read("documentation/index.html").decode()
    assert (said["author"], said["license"]) == ('Ada "A." Lovelace', "Apache-2.0")
    assert said["description"] == "PD on the position over PD on the attitude: motion in, thrust and torque out"
    assert "quadcosim authors" not in page
    assert main("run", "hover_pd/system.toml", "--native").stdout.startswith("good: final_distance")
    period = ("--of", "components.controller.sampling.period", "--from", "0.1", "--to", "0.2", "--scan", "0.1")
    few_steps = ("--tolerance", "0.1", "--set", "components.plant.step=0.05")
    found = main("limit", "hover_pd/system.toml", "--native", *period, *few_steps).stdout
    assert "large_signal_limit  100 ms" in found
    assert "local_limit         111." in found
    drawn = here / "hover_pd" / "limit_components_controller_sampling_period.png"
    assert drawn.read_bytes().startswith(b"\x89PNG")


def test_it_is_written_where_it_is_asked_for(here: Path, main: Main) -> None:
    made = main("new", "controller", "mine", "--c", "--out", here / "deep" / "er")
    assert made.stdout.splitlines()[0] == f"{here}/deep/er/mine/mine.c"
    assert f"next: quadcosim run {here}/deep/er/mine/system.toml" in made.stderr


def test_each_passes_its_own_tests_and_a_mistake_is_reported_with_its_line(here: Path, main: Main) -> None:
    for name, kind in KINDS.items():
        write(kind, name, here, author="Ada", license="MIT")
    law = write("controller", "hover_pd", here, author="", license="")[0]
    flown_below = "not upright and not the_quadrotor_flies"
    command = [sys.executable, "-m", "pytest", "-p", "no:cacheprovider", "-k", flown_below, "."]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout
    assert "13 passed, 2 deselected" in done.stdout
    law.write_text(law.read_text(encoding="utf-8").replace("self.thrust =", "self.trust ="), encoding="utf-8")
    line = 1 + next(i for i, text in enumerate(law.read_text().splitlines()) if "self.trust" in text)
    for making in ((), ("--native",)):
        failed = main("run", "hover_pd/system.toml", *making, code=1).stderr.splitlines()[-1]
        assert f"hover_pd.py, line {line}: self.trust: no such variable; expected thrust, torque" in failed


@pytest.mark.parametrize("name", sample([*KINDS], 1))
def test_a_plant_and_a_filter_run_good_and_have_a_limit(name: str, here: Path) -> None:
    write(KINDS[name], name, here, author="Ada", license="MIT")
    builder.build_slaves(
        builder.slaves_of(here / name), here / name / "native", packing=builder.NATIVE
    )  # all in one process
    system = fmus.native_twins(load_system(here / name / "system.toml"))
    assert run(system).metrics["good"]
    of, first, last = LIMITS[name]
    found = limit.limit(system, of, first=first, last=last, scan=last - first, tolerance=last)
    assert found.large_signal_limit == first
    if KINDS[name] == "plant":
        _expect_linear_theory(system)


@in_test_all
def test_the_pendulum_has_the_local_limit_of_theory(here: Path) -> None:
    """The radius of the loop is 1 there, by the matrix exponential of the plant about upright."""
    write("plant", "pendulum", here, author="Ada", license="MIT")
    builder.build_slaves(builder.slaves_of(here / "pendulum"), here / "pendulum" / "native", packing=builder.NATIVE)
    system = fmus.native_twins(load_system(here / "pendulum" / "system.toml"))
    varied = Varied(request=system, of="components.controller.sampling.period")
    found = local_limits(varied, Range(first=0.05, step=0.05, last=0.25, tolerance=5e-4))
    assert found.limit == pytest.approx(0.225981, abs=5e-6)
    assert len(linearise(system).rest.A) == 2


def _expect_linear_theory(system: System) -> None:
    """It has margins, poles, an LQR, an expectation, and a certificate."""
    control = pytest.importorskip("control")
    (margins,) = bode(system).loops
    assert margins.gain_margin == pytest.approx(0.5 * 9.81 * 0.4 / 4.0, rel=1e-3), "k_p is m g l there"
    delays = Varied(request=system, of="connections.command.delay")
    late = local_limits(delays, Range(first=0.06, step=0.03, last=0.12, tolerance=5e-4))
    assert (late.limit, late.method) == (pytest.approx(margins.delay_margin, rel=1e-4), LOOP)
    loop = linearise(system)
    gain, _, poles = control.dlqr(loop.rest.to_control(), np.eye(2), np.eye(1))
    assert gain.shape == (1, 2)
    assert np.abs(poles).max() < 1.0
    expected = expect(changed(system, {"connections.measurement.noise": 0.001}))
    assert expected.mean_square_radius == pytest.approx(loop.radius**2, rel=1e-4)
    assert expected.objectives["error_rms"] == pytest.approx(3.18805e-4, rel=1e-5), "by Lyapunov's equation"
    assert margin(system, "connections.command.delay_jitter").certified == pytest.approx(0.01, rel=1e-6)


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("9lives", "expected a name of letters"),
        ("a.b", "expected a name of letters"),
        ("../up", r"as hover_pd; in another folder: up with out \.\.$"),
        ("é", "expected a name of letters"),
        ("json", "json is a module or a keyword of Python"),
        ("class", "class is a module or a keyword of Python"),
        ("numpy", "numpy is a module or a keyword of Python"),
        ("unified_controller", "an FMU of this project has this name"),
        ("slave", "expected another name, as my_slave"),
    ],
)
def test_names_that_would_not_work_are_refused(name: str, words: str, tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=words):
        write("controller", name, tmp_path, author="", license="")
    assert not [*tmp_path.iterdir()]


def test_what_is_there_is_not_touched(here: Path, main: Main) -> None:
    (here / "mine").mkdir()
    assert "mine: exists already" in main("new", "plant", "mine", code=2).stderr
    assert not [*(here / "mine").iterdir()]
    assert "new motor: expected controller, plant, filter" in main("new", "motor", "mine", code=2).stderr


def test_names_are_in_the_case_that_python_has_them_in() -> None:
    names = ("hover_pd", "HoverPd", "hover-pd", "PID")
    assert [class_name(name) for name in names] == ["HoverPd", "HoverPd", "HoverPd", "PID"]
    assert [module_name(class_name(name)) for name in names] == ["hover_pd", "hover_pd", "hover_pd", "pid"]


@in_test_all
def test_the_page_of_a_controller_says_how_far_from_the_target_wind_keeps_it_on_a_small_vehicle(
    here: Path, main: Main
) -> None:
    write("controller", "hover_pd", here, author="", license="")
    page = (here / "hover_pd" / "README.md").read_text(encoding="utf-8")
    flown = ("run", "--controller", "hover_pd/HoverPd.fmu", "--vehicle", "crazyflie", "--native", "--json")
    bound = json.loads(main(*flown).stdout)["ultimate_bound"]
    assert f"{100.0 * bound:.0f} cm in the wind of a Crazyflie" in page
