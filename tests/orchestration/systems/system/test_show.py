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

SYSTEM = Path(__file__).with_name("test_show.toml").read_text(encoding="utf-8")

TEXT = Path(__file__).with_name("test_show.txt").read_text(encoding="utf-8")


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
