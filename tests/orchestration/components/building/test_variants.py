"""FMUs of one slave with values that are fixed: constants to whoever reads them, and the flights of the general one."""

from pathlib import Path

import fmpy
import pytest
from fmpy.validation import validate_fmu

from fmu_kit.archive import read_source_hash
from orchestration.command.variant_flags import VariantFlags
from orchestration.components.building import builder, fmus
from orchestration.components.checks.validation.validator import validate
from orchestration.components.fmi.read_description import read_model
from orchestration.quadrotor.scenarios.vehicle import load_vehicle
from orchestration.simulation.interop.catalogue import chosen
from orchestration.simulation.interop.compare import TOLERANCE, agreements
from quadcosim import Result, Scenario, UsageError, run
from tests.commands import Main
from tests.extent import sample
from tests.native import kept
from tests.orchestration.simulation.interop.common import LOOP, farthest

MAKINGS = {"native": builder.NATIVE, "python": builder.IN_PYTHON, "FMI 3": builder.NATIVE_FMI_3}
REDESIGN: dict[str, float | str] = {
    "discretisation": "mean",
    "stages": 2,
    "hold_period": 0.05,
    "gain.eta": 12.0,
    "surface_exponent": 0.9,
}
TIMING = {"period": 0.05, "plant_interval": 0.005, "delay": 0.01}
CRAZYFLIE = {**load_vehicle("crazyflie", Path()).for_controller("UnifiedController"), **REDESIGN}


@pytest.fixture(scope="module", params=sample([*MAKINGS], 1))
def fixed(request: pytest.FixtureRequest) -> Path:
    """A redesign for one period and one vehicle, as an FMU of each making in turn."""
    flags = VariantFlags(
        set=[f"{key}={value}" for key, value in REDESIGN.items()], vehicle="crazyflie", name="Redesign"
    )
    slaves = flags.applied_to(builder.slaves_named("UnifiedController"))
    folder, packing = kept("fixed", request.param), MAKINGS[request.param]
    if read_source_hash(folder / "Redesign.fmu") != packing.source_hash(slaves[0]):
        builder.build_slaves(slaves, folder, packing=packing)
    return folder / "Redesign.fmu"


def run_of(controller: str, **parameters: float | str) -> Result:
    """Half a second of a Crazyflie."""
    scenario = Scenario(vehicle=load_vehicle("crazyflie", Path()), stop_time=0.5).with_fmus(
        plant="native/QuadrotorPlant", controller=controller
    )
    values = {f"controller.{name}": value for name, value in parameters.items()}
    return run(scenario.with_changes(parameters=values, timing=TIMING))


def test_a_variant_flies_as_the_general_fmu_with_its_values_to_the_bit(
    fixed: Path, request: pytest.FixtureRequest
) -> None:
    folder = MAKINGS[request.node.callspec.params["fixed"]].folder
    one, other = run_of(str(fixed)), run_of(str(Path(folder, "UnifiedController")), **REDESIGN)
    assert one.columns == other.columns
    differing = [name for name in one.columns if one.signals[name].tobytes() != other.signals[name].tobytes()]
    assert differing == []
    assert one.events == other.events


def test_what_is_fixed_is_a_constant_and_all_else_is_where_it_was(fixed: Path) -> None:
    own, general = (read_model(path).variables for path in (fixed, fmus.locate("native/UnifiedController")))
    assert {name: variable.reference for name, variable in own.items() if name != "time"} == {
        name: variable.reference for name, variable in general.items()
    }
    constants = {name for name, variable in own.items() if variable.is_constant}
    assert constants == {
        *CRAZYFLIE,
        "inertia.xy",
        "inertia.xz",
        "inertia.yz",
        "discretisation_index",
        "gain_scaling_index",
    }
    assert {(own[name].causality, own[name].variability) for name in constants} == {("local", "constant")}
    starts = {
        name: own[name].start for name in ("discretisation", "discretisation_index", "stages", "mass", "gain.eta")
    }
    assert starts == {
        "discretisation": "4", "discretisation_index": "4", "stages": "2", "mass": "0.029", "gain.eta": "12.0",
    }  # fmt: skip
    others = [name for name in own if name not in constants and name != "time"]
    assert [own[name].causality for name in others] == [general[name].causality for name in others]


def test_no_rule_is_broken_and_other_software_reads_it(fixed: Path) -> None:
    description = fmpy.read_model_description(str(fixed), validate=True)
    assert (description.modelName, description.coSimulation.modelIdentifier) == ("Redesign", "Redesign")
    assert description.description.startswith("UnifiedController with discretisation = mean, gain.eta = 12.0, ")
    assert validate_fmu(str(fixed)) == []
    if description.fmiVersion == "2.0":
        assert validate(fixed) == []


def test_what_has_another_value_is_refused_and_what_has_its_own_is_not(fixed: Path) -> None:
    assert run_of(str(fixed), **{name: REDESIGN[name] for name in ("gain.eta", "discretisation")}).divergence is None
    with pytest.raises(
        UsageError, match=r"controller\.gain\.eta = 13: expected 12\.0, which is fixed .*: it is a constant local v"
    ):
        run_of(str(fixed), **{"gain.eta": 13})


MASTERS = {"native": ["libcosim", "libcosim, SSP", "ecos", "ecos, SSP"], "python": ["libcosim", "ecos"]}
"""By SSP they set the same parameters, whatever is inside of an FMU."""


@pytest.mark.parametrize("fixed", sample([*MASTERS], 1), indirect=True)
def test_a_redesign_that_is_fixed_flies_in_masters_that_set_no_enumeration(
    fixed: Path, request: pytest.FixtureRequest
) -> None:
    vehicle = load_vehicle("crazyflie", Path())
    scenario = Scenario(vehicle=vehicle, stop_time=0.3).with_fmus(plant="native/QuadrotorPlant", controller=fixed)
    scenario = scenario.with_changes(timing={"period": 0.05, "plant_interval": 0.01})
    for agreement in agreements(scenario, chosen(MASTERS[request.node.callspec.params["fixed"]], LOOP.ports)):
        assert farthest(agreement, agreement.same_first_inputs) <= TOLERANCE, agreement.tool.name


@pytest.mark.parametrize(
    ("flags", "message"),
    [
        (["--set", "mass=2"], "--set, --vehicle: expected --name NAME, the name of the FMU with these values"),
        (["--name", "2nd"], "--name 2nd: expected letters, digits and _, no digit first"),
        (["--name", "UnifiedController"], "--name UnifiedController: expected another name than that of a slave"),
        (["--name", "X", "--set", "mas=2"], "X: mas: no parameter of X; did you mean mass?"),
        (["--name", "X", "--set", "mass=0"], "X: mass = 0.0: expected a finite value > 0"),
        (["--name", "X", "--set", "stages=1.5"], "X: stages = 1.5: expected a whole number >= 1 and <= 100"),
        (["--name", "X", "--set", "thrust=1"], "X: thrust = a variable with causality output: expected a parameter"),
        (["--name", "X", "--set", "use_reference_inputs=1"], "X: use_reference_inputs = 1.0: expected true or false"),
        (["--name", "X", "--set", "discretisation_index=5"], "X: discretisation_index: expected discretisation, "),
        (["--name", "X", "--set", "discretisation=matched"], "X: discretisation = matched: expected 1 (explicit), 2 "),
        (
            ["GeometricController", "--name", "X", "--set", "discretisation=semi_implicit"],
            "X: discretisation = semi_implicit: expected another: this law has no semi-implicit form",
        ),
    ],
)
def test_what_cannot_be_fixed_is_refused_in_one_line(
    flags: list[str], message: str, main: Main, tmp_path: Path
) -> None:
    done = main("build", "--out", tmp_path, *flags, code=2 if message.startswith("--") else 1)
    (line,) = [line for line in done.stderr.splitlines() if "building: " not in line]
    assert message in line
    assert not any(tmp_path.iterdir())
