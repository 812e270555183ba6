"""Sweeps in which some system is none for SIMD lanes: all of their runs are done one at a time, and it is said why."""

from pathlib import Path
from typing import Any

import pytest
import tomli_w

from orchestration.experiments.studies.study_file import load_study
from orchestration.experiments.studies.sweep import prepare
from orchestration.foundation.basics.errors import UsageError
from tests.orchestration.components.fmi.small import needs_compiler

pytestmark = needs_compiler

PLANTS = ["native/QuadrotorPlant", "native/fmi3/QuadrotorPlant"]
NO_KIT = "components.plant: QuadrotorPlant.fmu: expected a native FMU of this project's kit"


def study(folder: Path, objective: str = "last(plant.position.z)", fmus: Any = PLANTS[:1], **keys: Any) -> Any:
    """A sweep over plants that fall."""
    component = {"fmu": "QuadrotorPlant", "step": 0.01, "parameters": {"thrust_max": 0.0}, **keys}
    system = {"stop_time": 0.1, "components": {"plant": component}, "objectives": {"fallen": objective}}
    (folder / "system.toml").write_text(tomli_w.dumps(system))
    axis = {"name": "plant", "sets": ["components.plant.fmu"], "values": [str(fmu) for fmu in fmus]}
    path = folder / "study.toml"
    path.write_text(tomli_w.dumps({"name": "falls", "scenario": "system.toml", "axes": [axis]}))
    return load_study(path)


@pytest.mark.parametrize("fmus", [PLANTS, PLANTS[::-1]])
def test_of_mixed_systems_none_flies_in_lanes(fmus: list[str], tmp_path: Path) -> None:
    of = study(tmp_path, fmus=fmus)
    _, execution, _ = prepare(of, "auto")
    assert (execution.in_lanes, execution.native, execution.failed) == (False, True, False)
    assert str(execution.reason).startswith(NO_KIT)
    with pytest.raises(UsageError, match=r"engine = batch: components.plant: QuadrotorPlant.fmu: expected a native"):
        prepare(of, "batch")


def test_nor_do_runs_by_model_exchange(tmp_path: Path) -> None:
    expected = r"components.plant.interface = model-exchange: expected co-simulation for one of many at once"
    _, execution, _ = prepare(study(tmp_path, interface="model-exchange"), "auto")
    assert (execution.in_lanes, execution.reason) == (False, expected)


def test_nor_do_those_that_ask_for_what_only_solvers_see(tmp_path: Path) -> None:
    expected = "plant.channels.a: expected none of the variables that are for solvers, for one of many at once"
    _, execution, _ = prepare(study(tmp_path, objective="last(plant.channels.a)"), "auto")
    assert (execution.in_lanes, execution.reason) == (False, expected)
