"""One FMU from its source to its flight: what `make check` has of all that comes between."""

import shutil
from pathlib import Path

import numpy as np
import pytest

import quadcosim
from quadcosim import Component, System
from tests.places import ROOT


def test_an_fmu_is_built_and_flies_as_its_equation_says(tmp_path: Path) -> None:
    shutil.copy(ROOT / "examples" / "double_integrator" / "plant.py", tmp_path)
    start = {"initial.x": 3.0, "initial.v": -0.5, "u": 0.25}
    plant = Component(fmu=str(tmp_path / "DoubleIntegrator.fmu"), step=0.05, parameters=start)
    signals = quadcosim.run(System(stop_time=2.0, components={"plant": plant})).signals
    t = signals["time"]
    assert t[-1] == pytest.approx(2.0)
    assert signals["plant.x"] == pytest.approx(3.0 - 0.5 * t + 0.125 * t**2)
    assert signals["plant.v"] == pytest.approx(-0.5 + 0.25 * t)
    assert len(np.unique(signals["plant.x"])) > 20
