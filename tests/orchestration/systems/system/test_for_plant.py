"""`quadcosim new controller --for`: the controller is built as written, and fits its plant, whatever the names."""

import html
from pathlib import Path

import pytest

from fmu_kit.declared_names import PYTHONFMU_NAMES
from fmu_kit.slave import Slave
from orchestration.components.building import builder
from orchestration.components.fmi.read_description import read_model
from orchestration.systems.system.check import check
from orchestration.systems.system.file import load_system
from orchestration.systems.system.for_plant import OF_SLAVES
from tests.commands import Main
from tests.orchestration.systems.system.described import described

OUTPUTS = {"step": "Real degC", "body.v[1]": "Real m/s", "body_v_1": "Real", "on": "Boolean", "n": "Integer"}
INPUTS = {"class": "Real rpm", "2nd": "Real N", "say &quot;u&quot;": "Real", "valve": "Boolean", "der(é)": "Integer"}


def test_a_controller_for_a_plant_is_built_as_written_and_fits_it(
    tmp_path: Path, main: Main, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    plant = described(tmp_path, "Tank", inputs=INPUTS, outputs=OUTPUTS)
    written = main("new", "controller", "law", "--for", plant.name, "--author", "Ada").stdout.split()
    assert written == ["law/law.py", "law/system.toml", "law/README.md"]
    (built,) = builder.build_slaves(builder.slaves_of(Path("law")), Path("law"))
    law = read_model(built)
    assert law.names("input") == tuple(OUTPUTS)
    assert law.names("output") == tuple(map(html.unescape, INPUTS))
    assert [law.variables[name].unit for name in ("body.v[1]", "2nd", "class", "step")] == ["m/s", "N", None, None]
    assert "rpm" in (law.variables["class"].description or "")
    system = load_system(Path("law/system.toml"))
    assert Path(system.components["plant"].fmu).resolve() == plant.resolve()
    check(system, {"plant": read_model(plant), "controller": law})


def test_a_name_that_every_slave_has_is_known() -> None:
    own = {name for name in (*dir(Slave), *Slave.__annotations__, *PYTHONFMU_NAMES) if not name.startswith("_")}
    assert own <= set(OF_SLAVES.split())


def test_a_plant_without_commands_and_another_kind_are_refused(tmp_path: Path, main: Main) -> None:
    plant = described(tmp_path, "Source", inputs={}, outputs={"y": "Real"})
    refused = main("new", "controller", "law", "--for", plant, "--out", tmp_path, code=2).stderr
    assert "Source has no inputs; expected a plant" in refused
    refused = main("new", "filter", "low", "--for", plant, "--out", tmp_path, code=2).stderr
    assert "expected new controller, without --c" in refused
    assert not (tmp_path / "law").exists()
