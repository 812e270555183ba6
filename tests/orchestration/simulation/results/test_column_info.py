"""The units and descriptions of columns are those of the FMUs."""

from pathlib import Path

import quadcosim
from quadcosim import Scenario, load_run, save_run


def test_columns_have_the_units_and_descriptions_of_the_fmus_and_runs_the_parameters_they_were_flown_with(
    tmp_path: Path,
) -> None:
    original = quadcosim.run(Scenario(stop_time=0.05).with_changes(parameters={"plant.thrust_max": 25.0}))
    result = load_run(save_run(original, tmp_path / "run", figures=False))
    assert set(result.described) == set(result.columns)
    assert {result.described[name].unit for name in ("plant.torque.x", "controller.torque.z")} == {"N.m"}
    assert result.described["controller.position_error.x"].text == "P - P_d as of the last sample, inertial frame"
    assert (result.described["reference.position.x"].unit, result.described["time"].unit) == ("m", "s")
    assert (result.parameters["plant.thrust_max"], result.parameters["controller.gain.surface"]) == (25.0, 5.0)
    assert (result.described, result.parameters) == (original.described, original.parameters)
