"""`quadcosim show` and `quadcosim schema`: a system as text, as a figure, and the keys of its file."""

import json
from pathlib import Path

import pytest

from orchestration.foundation.basics.unit_algebra import time_text
from orchestration.simulation.figures import diagram
from orchestration.systems.system.description import as_text
from orchestration.systems.system.file import load_system
from tests.commands import Main
from tests.pictures import expect_picture

SYSTEM = """
stop_time = 5.0
[components.motor]
fmu = "motor.fmu"
step = 0.001
[components.filter]
fmu = "filter.fmu"
sampling = { period = 0.002, jitter = 0.0005 }
[components.controller]
fmu = "controller.fmu"
parameters = { gain = 2.0 }
sampling = { period = 0.01, offset = 0.001, clock_ratio = 1.001 }
[[connections]]
from = ["motor.angle"]
to = ["filter.u"]
quantisation = 0.001
[[connections]]
name = "bus"
from = ["filter.y.a", "filter.y.b"]
to = ["controller.y.a", "controller.y.b"]
delay = 0.003
delay_jitter = 0.001
loss = 0.1
burst_length = 3
[[connections]]
from = ["controller.u"]
to = ["motor.voltage"]
hold = "first"
noise = 0.01
order = "jacobi"
[sources.load]
to = ["motor.load"]
noise = 0.1
period = 0.01
[objectives]
peak = "max(motor.angle)"
[criterion]
good = "peak < 1"
"""

TEXT = """\
3 components, 3 connections, 5 s

components
  motor       motor.fmu       continuous, step 1 ms
  filter      filter.fmu      every 2 ms, jitter 500 µs uniform
  controller  controller.fmu  every 10 ms, from 1 ms, clock 1.001 times true time  gain = 2.0

connections
  0    motor -> filter       quantisation 0.001                                               angle -> u
  bus  filter -> controller  delay 3 ms, delay jitter 1 ms uniform, loss 10 % in bursts of 3  y.{a,b}
  2    controller -> motor   hold first, noise 0.01, jacobi                                   u -> voltage

sources
  load  white noise of intensity 0.1, held 10 ms  motor.load

objectives
  peak  max(motor.angle)

criterion
  good  peak < 1
"""


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "system.toml"
    path.write_text(SYSTEM, encoding="utf-8")
    return path


def test_components_connections_and_their_timing_are_shown(file: Path, main: Main) -> None:
    assert main("show", file).stdout == TEXT


def test_flags_change_what_is_shown(file: Path, main: Main) -> None:
    assert "delay 4 ms, delay jitter" in main("show", file, "--set", "connections.bus.delay=0.004").stdout
    assert "command      controller -> plant  delay 4 ms" in main("show", "--delay", "0.004").stdout


def test_noise_of_a_signal_outside_the_message_is_rejected_in_terms_of_the_request(file: Path, main: Main) -> None:
    file.write_text(SYSTEM.replace("noise = 0.01", "noise = { volts = 0.01 }"), encoding="utf-8")
    for given, message in (
        ([file], f"{file}: connections.2.noise: volts is no signal of it; expected one of u"),
        (["--noise", "angle=0.1"], "timing.noise: angle is no signal of it; expected one of position, velocity, "),
    ):
        assert main("show", *given, code=2).stderr.startswith(f"quadcosim: {message}")


def test_times_have_a_readable_unit() -> None:
    values = [0.0, 2.0, 0.25, 1e-3, 2.5e-6, 3e-9]
    assert [time_text(value) for value in values] == ["0 s", "2 s", "250 ms", "1 ms", "2.5 µs", "3 ns"]


def test_the_figure_has_a_box_for_each_component_and_source_and_a_label_for_each_message(file: Path) -> None:
    figure = diagram.draw(load_system(file))
    (axes,) = figure.axes
    message = [text.get_text() for text in axes.texts]
    boxes = [text.get_text() for text in axes.texts if text.get_fontweight() == "bold"]
    assert boxes == ["load", "motor", "filter", "controller"]
    for label in ("angle\nquantisation 0.001", "bus: y.a, y.b\ndelay 3 ms", "u\nhold first", "load"):
        assert any(text.startswith(label) for text in message), label


def test_nothing_in_the_figure_overlaps(file: Path) -> None:
    figure = diagram.draw(load_system(file))
    figure.canvas.draw()
    (axes,) = figure.axes
    boxes = [text.get_window_extent() for text in axes.texts]
    for i, one in enumerate(boxes):
        assert axes.bbox.x0 <= one.x0 <= one.x1 <= axes.bbox.x1
        assert not any(one.overlaps(other) for other in boxes[i + 1 :]), axes.texts[i].get_text()


def test_the_figure_is_written_to_the_given_path(file: Path, main: Main) -> None:
    out = file.parent / "new" / "figure.png"
    assert main("show", file, "--out", out).stderr == f"{out}\n"
    expect_picture(out)
    refused = main("show", file, "--out", file.parent / "figure.docx", code=2).stderr
    assert refused.startswith(f"quadcosim: --out {file.parent / 'figure.docx'}: expected a figure ending in one of")


def test_the_quadrotor_is_shown_like_any_other_system() -> None:
    from orchestration.quadrotor.scenarios.translation import quadrotor

    assert "measurement  plant -> controller  at once  position.{x,y,z}, velocity.{x,y,z}" in as_text(quadrotor())


def test_the_schema_names_every_table_and_describes_its_keys(main: Main) -> None:
    schema = json.loads(main("schema").stdout)
    assert schema["title"] == "quadcosim system"
    assert {"stop_time", "components", "connections", "sources", "objectives", "criterion"} <= set(schema["properties"])
    tables = [schema, *schema["$defs"].values()]
    assert all(key.get("description") for table in tables for key in table["properties"].values())
    assert not any(table["additionalProperties"] for table in tables)
    assert {"from", "to"} <= set(schema["$defs"]["ConnectionTable"]["required"])
