"""FMUs of FMI 1.0 for co-simulation, by one that is compiled here: exact rows, and what they cannot do by name."""

import zipfile
from pathlib import Path

import fmpy
import numpy as np
import pytest

from orchestration.components.fmi.isolated_instance import IsolatedInstance
from orchestration.components.fmi.opening import open_here
from orchestration.components.fmi.read_description import read_model
from orchestration.foundation.basics.errors import SimulatorError
from quadcosim import UsageError, run
from tests import native
from tests.commands import Main
from tests.orchestration.components.fmi.small import COMPILER, known, needs_compiler, small

pytestmark = needs_compiler

_ALONE = """<Implementation><CoSimulation_StandAlone>
    <Capabilities canHandleVariableCommunicationStepSize="true"/></CoSimulation_StandAlone></Implementation>"""
_DESCRIPTION = f"""<fmiModelDescription fmiVersion="1.0" modelName="Old" modelIdentifier="Old" guid="old"
    numberOfContinuousStates="0" numberOfEventIndicators="0">
  <DefaultExperiment startTime="0" stopTime="1"/>
  <ModelVariables>
    <ScalarVariable name="u" valueReference="0" causality="input"><Real start="0"/></ScalarVariable>
    <ScalarVariable name="y" valueReference="1" causality="output"><Real start="0"/><DirectDependency/></ScalarVariable>
    <ScalarVariable name="gain" valueReference="2" variability="parameter"><Real start="1"/></ScalarVariable>
    <ScalarVariable name="limit" valueReference="7" variability="parameter"><Real start="1e9"/></ScalarVariable>
    <ScalarVariable name="on" valueReference="3" causality="input" variability="discrete"><Boolean start="true"/>
    </ScalarVariable>
    <ScalarVariable name="high" valueReference="4" causality="output" variability="discrete"><Boolean/></ScalarVariable>
    <ScalarVariable name="twice" valueReference="5" causality="output"><Real/></ScalarVariable>
    <ScalarVariable name="span" valueReference="6" causality="internal"><Real/></ScalarVariable>
    <ScalarVariable name="minus_y" valueReference="1" alias="negatedAlias"><Real/></ScalarVariable>
  </ModelVariables>
  {_ALONE}
</fmiModelDescription>"""
_SYSTEM = Path(__file__).with_name("test_fmi1.toml").read_text(encoding="utf-8")
_RUN = ("run", "system.toml", "--in-process")


@pytest.fixture(scope="module")
def library() -> bytes:
    return native.library(str(COMPILER), Path(__file__).with_name("fmi1.c"))


@pytest.fixture
def old(library: bytes, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return known(written(tmp_path / "old.fmu", library))


def written(path: Path, library: bytes, description: str = _DESCRIPTION) -> Path:
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr(zipfile.ZipInfo("modelDescription.xml"), description)  # of the same bytes each time
        archive.writestr(zipfile.ZipInfo(f"binaries/{fmpy.platform}/Old{fmpy.sharedLibraryExtension}"), library)
    return path


def test_rows_of_one_fmu_alone_are_exact(main: Main, old: Path) -> None:
    Path("in.csv").write_text("time,u,on\n0,1,1\n0.5,3,0\n1,3,1\n")
    chosen = [word for name in ("y", "high", "twice") for word in ("--record", name)]
    flags = ("--set", "gain=0.5", "--output-interval", "0.25", "--output", "out.csv")
    main("run", old, "--inputs", "in.csv", *chosen, *flags)
    assert Path("out.csv").read_text().splitlines() == [
        '"time","y","twice","high"',
        "0.0,0.0,2.0,False",
        "0.25,0.125,2.0,True",
        "0.5,0.375,4.0,True",
        "0.75,0.375,6.0,True",
        "1.0,0.375,6.0,True",
    ]


def test_validate_runs_it_and_says_that_it_tries_nothing_else(main: Main, old: Path, library: bytes) -> None:
    assert main("validate", old).stdout.splitlines() == [
        "no problems in the FMU",
        f"{old}: no problems found",
        "  note: run-of-fmi1: FMI 1.0: its description was read, and it was run; no other rule was tried",
    ]
    large = _DESCRIPTION.replace('<Real start="0"/></ScalarVariable>', '<Real start="1e308"/></ScalarVariable>', 1)
    written(Path("bad.fmu"), library, large)
    assert "run-of-fmi1: co-simulation: twice = inf after step 1" in main("validate", "bad.fmu", code=1).stdout


def test_rows_under_a_sampled_controller_are_exact(main: Main, old: Path) -> None:
    known(small(old.parent))
    Path("system.toml").write_text(_SYSTEM)
    signals, y, u, expected = run("system.toml", in_process=True).signals, 1.0, 0.0, [1.0]
    for step in range(8):
        u -= 0.25 * y if step % 2 == 0 else 0.0
        y += 2.0 * u * 0.125
        expected.append(y)
    assert signals["plant.y"].tolist() == expected
    assert signals["plant.high"].tolist() == [value > 0.1 for value in expected]
    assert signals["plant.span"].tolist() == [1.0] * 9
    refused = "components.plant does more than call its FMU"
    assert f"--engine compiled is not available: {refused}" in main(*_RUN, "--engine", "compiled", code=1).stderr
    refused = "the FMU of plant cannot save its state"
    assert f"pause: {refused}; expected" in main(*_RUN, "--pause-at", "0.5", "--out", "paused", code=2).stderr
    assert refused in main("linearise", "system.toml", code=2).stderr


def test_an_instance_in_a_process_of_its_own_has_the_same_bits_and_is_reset(old: Path) -> None:
    with IsolatedInstance(old, "far") as far, open_here(old, "near") as near:
        values = [(np.zeros(1), instance) for instance in (far, near, near)]
        for into, instance in values:
            instance.reset()
            instance.set("gain", 3.0)
            read = instance.reader(("y",), into)
            instance.initialise(("u",), np.array([0.1]))
            for i in range(3):
                instance.step(0.5 * i, 0.5)
            read()
        assert [into[0] for into, _ in values] == [sum([3.0 * 0.1 * 0.5] * 3)] * 3
        with pytest.raises(UsageError, match=r"^near: tolerance = 0.1: expected none, as FMI 1.0 has none in co-simul"):
            near.set_tolerance(0.1)


def test_a_discarded_step_is_told_with_the_message_of_the_fmu(old: Path) -> None:
    with open_here(old, "it") as instance:
        instance.set("limit", 0.5)
        instance.initialise((), np.zeros(0))
        instance.step(0.0, 0.5)
        with pytest.raises(
            SimulatorError, match=r"^it \(Old\): fmiDoStep: discards the step to 1 s: it stands at 0.5$"
        ):
            instance.step(0.5, 0.5)


def test_what_a_description_says_is_read_in_the_terms_of_fmi_2(old: Path) -> None:
    model = read_model(old)
    assert (model.version, model.varies_step, model.saves_state, model.has_slopes) == (1, True, False, False)
    assert {name: v.causality for name, v in model.variables.items()} == {
        "u": "input", "y": "output", "gain": "parameter", "limit": "parameter", "on": "input", "high": "output",
        "twice": "output", "span": "local",
    }  # fmt: skip
    assert (model.depends_on("y"), model.depends_on("twice")) == (frozenset(), None)
    assert model.variables["y"].has_settable_start
    assert not model.variables["twice"].has_settable_start


@pytest.mark.parametrize(
    ("implementation", "found"),
    [
        ("", "model exchange"),
        (_ALONE.replace("StandAlone", "Tool"), "co-simulation with the tool that wrote it"),
    ],
)
def test_what_is_no_co_simulation_by_itself_is_refused_by_name(
    main: Main, library: bytes, tmp_path: Path, implementation: str, found: str
) -> None:
    path = written(tmp_path / "other.fmu", library, _DESCRIPTION.replace(_ALONE, implementation))
    expected = f"FMI 1.0 for {found}; of FMI 1.0 expected co-simulation of an FMU by itself"
    assert expected in main("run", path, code=2).stderr
