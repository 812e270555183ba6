"""`quadcosim new controller --for`: the controller is built as written, and fits its plant, whatever the names."""

import html
import re
from pathlib import Path

import pytest

from fmu_kit.declared_names import PYTHONFMU_NAMES
from fmu_kit.slave import Slave
from orchestration.components.building import builder, wrap
from orchestration.components.fmi.read_description import read_model
from orchestration.systems.system.check import check
from orchestration.systems.system.file import load_system
from orchestration.systems.system.for_plant import OF_SLAVES
from tests.commands import Main
from tests.orchestration.systems.system.described import described
from tests.places import EXAMPLES

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


def test_one_in_c_is_wrapped_as_written_under_the_names_that_c_can_have(
    tmp_path: Path, main: Main, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    real = dict.fromkeys(INPUTS, "Real") | {"2nd": "Real N", "class": "Real degC", "double": "Real", "a.c": "Real"}
    plant = described(tmp_path, "Tank", inputs=real, outputs=OUTPUTS)
    main("new", "controller", "law", "--c", "--for", plant.name, "--author", "Ada")
    law = read_model(wrap.locate(Path("law/law.toml")))
    assert law.names("input") == ("step", "body_v_1", "body_v_1_", "on", "n")
    assert law.names("output") == ("class", "v2nd", "say_u", "valve", "der", "double", "a.c")
    assert [law.variables[name].unit for name in ("body_v_1", "v2nd", "class", "step")] == ["m/s", "N", None, None]
    check(load_system(Path("law/system.toml")), {"plant": read_model(plant), "controller": law})


def test_one_in_c_flies_and_commands_what_its_step_says(tmp_path: Path, main: Main) -> None:
    tank = EXAMPLES / "water_tank" / "Tank.fmu"
    law, _, _, system, _ = main("new", "controller", "law", "--c", "--for", tank, "--out", tmp_path).stdout.split()
    as_it_is = "    /* As it is, the outputs stay as they were set above. */"
    before, after = Path(law).read_text(encoding="utf-8").split(as_it_is)
    Path(law).write_text(f"{before}    out->valve_control = in->level < 1e3 ? 0.25 : 0.0;{after}", encoding="utf-8")
    with Path(system).open("a", encoding="utf-8") as file:
        file.write('\n[objectives]\nopened = "max(plant.valve_control)"\n')
    assert re.search(r"opened +0.25\b", main("run", system, "--stop-time", "0.1").stdout)


def test_a_measured_state_starts_as_it_does_in_the_plant(tmp_path: Path, main: Main) -> None:
    servo = EXAMPLES / "dc_servo" / "Servo.fmu"
    law, *_ = main("new", "controller", "law", "--for", servo, "--out", tmp_path).stdout.split()
    assert '"angle of the shaft", "rad", 1.0)' in Path(law).read_text(encoding="utf-8")


def test_a_name_that_every_slave_has_is_known() -> None:
    own = {name for name in (*dir(Slave), *Slave.__annotations__, *PYTHONFMU_NAMES) if not name.startswith("_")}
    assert own <= set(OF_SLAVES.split())


def test_a_plant_without_commands_and_another_kind_are_refused(tmp_path: Path, main: Main) -> None:
    plant = described(tmp_path, "Source", inputs={}, outputs={"y": "Real"})
    refused = main("new", "controller", "law", "--for", plant, "--out", tmp_path, code=2).stderr
    assert "Source has no inputs; expected a plant" in refused
    refused = main("new", "filter", "low", "--for", plant, "--out", tmp_path, code=2).stderr
    assert refused.endswith("expected new controller\n")
    valve = described(tmp_path, "Valve", inputs={"open": "Boolean"}, outputs={"y": "Real"})
    refused = main("new", "controller", "law", "--c", "--for", valve, "--out", tmp_path, code=2).stderr
    assert "open is Boolean; expected Real inputs, as outputs of C are; without --c, a law in Python" in refused
    assert not (tmp_path / "law").exists()
