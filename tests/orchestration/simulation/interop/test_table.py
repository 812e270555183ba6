"""The agreements as text, as JSON and as a chart."""

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from orchestration.simulation.interop import compare, figure
from orchestration.simulation.interop.catalogue import TOOLS
from orchestration.simulation.interop.compare import Agreement
from tests.orchestration.simulation.interop.common import agreement
from tests.pictures import expect_picture

SEVERAL = [
    agreement("fmpy, plant alone"),
    agreement("libcosim", same_first_inputs=3e-14, as_it_comes=3e-14),
    agreement("fmucontainer", first=("exchanged", "start values")),
    agreement("fmpy, controller alone"),
]


# -- whether it holds -------------------------------------------------------------------------------------


@pytest.mark.parametrize(("difference", "holds"), [(0.0, True), (1e-9, True), (1.0000001e-9, False), (math.inf, False)])
def test_a_tool_agrees_up_to_1e_9_in_every_state_from_the_same_start(difference: float, holds: bool) -> None:
    found = agreement(same_first_inputs=0.0)
    for name in [name for name in found.same_first_inputs if name.startswith("plant.")]:
        found.same_first_inputs[name] = difference
        assert compare.agrees(found) == holds
        found.same_first_inputs[name] = 0.0


def test_the_command_counts_only_where_no_plant_is_run() -> None:
    for tool, holds in (("libcosim", True), ("fmpy, plant alone", True), ("fmpy, controller alone", False)):
        found = agreement(tool)
        found.same_first_inputs.update(
            {name: 1.0 for name in found.same_first_inputs if name.startswith("controller.")}
        )
        assert compare.agrees(found) == holds


def test_how_it_comes_does_not_count() -> None:
    assert compare.agrees(agreement(as_it_comes=1.0))


# -- text and JSON ----------------------------------------------------------------------------------------


def test_the_text_is_a_markdown_table_with_a_row_for_each_tool() -> None:
    head, rule, *rows = compare.text(SEVERAL).splitlines()
    assert len(rows) == len(SEVERAL)
    columns = cells(head)
    assert columns[:3] == ["tool", "order", "inputs of the first step"]
    assert all(set(cell) == {"-"} for cell in rule.strip("|").split("|"))
    assert {len(line) for line in (head, rule, *rows)} == {len(head)}, "aligned"
    assert {line.count("|") for line in (head, rule, *rows)} == {len(columns) + 1}
    assert [cells(row)[0] for row in rows] == [found.tool.name for found in SEVERAL]


def test_a_row_says_what_was_found() -> None:
    text = compare.text(SEVERAL).splitlines()
    assert cells(text[3]) == [
        "libcosim", "jacobi", "exchanged", "3000", "30 s", "2e-12 s",
        "3.0e-14 plant.velocity.z", "3.0e-14 plant.velocity.z",
    ]  # fmt: skip
    assert cells(text[4])[2] == "controller: exchanged, plant: start values"
    assert cells(text[5])[6] == "1.0e-03 controller.torque.z"


def cells(row: str) -> list[str]:
    assert row.startswith("| ")
    assert row.endswith(" |")
    return [cell.strip() for cell in row[1:-1].split("|")]


def test_all_that_was_found_is_there_in_json_types() -> None:
    for found in SEVERAL:
        document = compare.as_dict(found)
        assert json.loads(json.dumps(document)) == document
        assert document["tool"] == found.tool.name
        assert document["versions"].keys() == set(found.tool.packages)
        assert document["agrees"] is True
        assert (document["steps"], document["end"], document["drift"], document["order"]) == (
            3000,
            30.0,
            2e-12,
            "jacobi",
        )
        assert document["first_inputs"] == found.trace.first_exchange
        assert (document["as_it_comes"], document["same_first_inputs"]) == found.both()
    assert compare.as_dict(agreement(same_first_inputs=1e-8))["agrees"] is False


# -- the chart --------------------------------------------------------------------------------------------


def markers(found: list[Agreement]) -> list[Any]:
    """What is drawn but for the line of the aim."""
    (panel,) = figure.agreement_chart(found).axes
    return [line for line in panel.get_lines() if line.get_marker() not in ("None", None)]


def test_each_kind_of_signal_has_an_open_and_a_filled_marker() -> None:
    drawn = markers([agreement("libcosim", same_first_inputs=1e-12, as_it_comes=1e-3)])
    assert sorted(line.get_marker() for line in drawn) == sorted("os^DP" * 2)
    for line in drawn:
        is_open = line.get_markerfacecolor() == "none"
        assert line.get_xdata() == [1e-3 if is_open else 1e-12]
    assert sum(line.get_markerfacecolor() == "none" for line in drawn) == 5


def test_a_tool_of_one_component_has_the_markers_of_that() -> None:
    assert {line.get_marker() for line in markers([agreement("fmpy, plant alone")])} == set("os^D")
    assert {line.get_marker() for line in markers([agreement("fmpy, controller alone")])} == {"P"}


def test_there_is_a_row_for_each_tool_from_the_top() -> None:
    chart = figure.agreement_chart(SEVERAL)
    (panel,) = chart.axes
    assert [label.get_text() for label in panel.get_yticklabels()] == [found.tool.name for found in SEVERAL]
    assert panel.yaxis_inverted()
    for line in panel.get_lines():
        if line.get_marker() == "^":
            assert np.ravel(line.get_ydata())[0] in range(len(SEVERAL))


def test_the_legend_names_what_any_tool_has_and_the_aim() -> None:
    for found, names in (
        (SEVERAL, ["position", "velocity", "quaternion", "angular velocity", "command", "aim, $10^{-9}$"]),
        (SEVERAL[::-1], ["position", "velocity", "quaternion", "angular velocity", "command", "aim, $10^{-9}$"]),
        (SEVERAL[3:], ["command", "aim, $10^{-9}$"]),
    ):
        (legend,) = figure.agreement_chart(found).legends
        assert [text.get_text() for text in legend.get_texts()] == names


def test_a_difference_of_zero_is_drawn_at_the_left_of_a_logarithmic_axis(tmp_path: Path) -> None:
    found = [agreement("libcosim", same_first_inputs=0.0, as_it_comes=0.0)]
    assert {line.get_xdata()[0] for line in markers(found)} == {figure.ZERO_DRAWN_AT}
    (panel,) = figure.agreement_chart(found).axes
    assert panel.get_xscale() == "log"
    low, high = panel.get_xlim()
    assert 0.0 < low < figure.ZERO_DRAWN_AT < compare.TOLERANCE < high


def test_the_chart_is_written_into_a_folder_that_need_not_be_there(tmp_path: Path) -> None:
    all_tools = [agreement(name) for name in TOOLS]
    pictures = [
        picture for folder in ("one", "two") for picture in figure.draw(all_tools, tmp_path / "new" / folder)[:1]
    ]
    assert pictures[0] == tmp_path / "new" / "one" / "interop.png"
    expect_picture(pictures[0])
    assert pictures[0].read_bytes() == pictures[1].read_bytes()
