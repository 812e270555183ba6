"""`quadcosim show MODEL.fmu`: what an FMU declares."""

import json
from pathlib import Path

import fmpy

from orchestration.components.fmi.facts import facts
from orchestration.components.fmi.read_description import read_model
from tests.commands import Main
from tests.orchestration.components.fmi.exchange import clock, exchange, law
from tests.orchestration.components.fmi.small import needs_compiler, small


@needs_compiler
def test_show_answers_what_fmpy_reads_and_what_a_master_needs(main: Main, tmp_path: Path) -> None:
    fmu = small(tmp_path, fmi=3, fixed_step=True)
    shown, read = main("show", fmu).stdout.splitlines(), fmpy.read_model_description(str(fmu), validate=False)
    assert shown[0] == "Small: FMI 3.0, co-simulation; 2 inputs, 3 outputs, 2 parameters"
    assert "  canHandleVariableCommunicationStepSize  no" in shown
    assert "u         input      continuous   Float64[2]                                     0 0" in shown
    assert any("Enumeration (1 = forward, 2 = backward)" in line for line in shown)
    document = json.loads(main("show", fmu, "--json").stdout)
    assert document["verdict"] == shown[0]
    assert {v["name"] for v in document["variables"]} == {v.name for v in read.modelVariables}
    assert document["token"] == read.guid
    (mode,) = (v for v in document["variables"] if v["name"] == "mode")
    assert mode["choices"] == {"forward": 1, "backward": 2}
    flagged = main("show", fmu, "--set", "gain=2").stdout
    assert flagged.startswith("1 components")
    assert "gain = 2.0" in flagged


@needs_compiler
def test_clocks_and_states_are_among_the_facts(tmp_path: Path) -> None:
    clocked = facts(read_model(law(tmp_path, clock("fast"), clock("own", "triggered", "", 31))))
    assert [(each["name"], each["variability"], each["interval"]) for each in clocked.clocks] == [
        ("fast", "constant", 0.5),
        ("own", "triggered", None),
    ]
    assert "2 clocks" in clocked.verdict
    for fmi in (2, 3):
        of = facts(read_model(exchange(tmp_path, "ball", fmi=fmi, slopes=True)))
        assert (of.continuous_states, of.event_indicators) == (2, 1)
        assert of.interfaces["model-exchange"]["providesDirectionalDerivatives"] is True
