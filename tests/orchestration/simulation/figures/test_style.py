"""Sizes, fonts and bytes of figures."""

import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from matplotlib.figure import Figure
from PIL import Image

from orchestration.command.figure_flags import FigureFlags
from orchestration.simulation.figures.names import FORMATS
from orchestration.simulation.figures.style import DOCS, STYLES, Style, save
from quadcosim import UsageError


def drawn(style: Style) -> Figure:
    with style.applied():
        figure = style.figure(20.0)
        panel = figure.add_subplot()
        panel.plot([0.0, 1.0, 2.0], [1.0, 3.0, 2.0], label="a, and what the fonts lack: 測")
        panel.set(xlabel="time [s]", ylabel=r"$\beta_t$ ε [1]")
        panel.legend()
    return figure


def test_the_same_data_give_the_same_bytes_in_every_format_and_text_stays_text_with_its_font(tmp_path: Path) -> None:
    style = replace(STYLES["paper"], formats=FORMATS, dpi=60.0)
    one, other = ([path.read_bytes() for path in save({"a": drawn(style)}, tmp_path / k, style)] for k in "12")
    assert one == other
    _, svg, pdf = one
    assert b"<dc:date>" not in svg
    assert b">time [s]</text>" in svg
    assert b"STIXGeneral" in svg
    assert b"CreationDate" not in pdf
    assert b"/FontFile2" in pdf
    assert b"/Type3" not in pdf


def test_a_figure_has_the_size_that_was_asked_for_to_a_tenth_of_a_millimetre(tmp_path: Path) -> None:
    style = FigureFlags(format=["svg"], style="paper", width="single").figure_style
    (path,) = save({"a": drawn(style)}, tmp_path, style)
    width = re.search(r'<svg[^>]* width="([\d.]+)pt"', path.read_text(encoding="utf-8"))
    assert width is not None
    assert float(width[1]) * 25.4 / 72.0 == pytest.approx(88.9, abs=0.1)
    (label,) = [line for line in path.read_text(encoding="utf-8").splitlines() if ">time [s]<" in line]
    assert "font-size: 8px; font-family: 'STIXGeneral'" in label or "font: 8px 'STIXGeneral'" in label, "8 pt"
    sized = FigureFlags(size="120x80mm", font_size=9.0).figure_style
    assert (sized.width, sized.height, sized.font) == (120.0, 80.0, 9.0)


def test_a_figure_too_narrow_for_its_text_is_refused() -> None:
    with pytest.raises(UsageError, match=r"40: 40 mm are too narrow .* 10 points; .* at least 53 mm"):
        FigureFlags(width="40")
    assert FigureFlags(width="40", font_size=7.0).figure_style.width == 40.0


def test_every_figure_is_written_as_a_sharp_picture_and_as_svg_unless_other_formats_are_asked_for(
    tmp_path: Path,
) -> None:
    assert [path.name for path in save({"a": drawn(STYLES["screen"])}, tmp_path)] == ["a.png", "a.svg"]
    with Image.open(tmp_path / "a.png") as picture:
        assert picture.size[0] == int(203.0 / 25.4 * 200.0)
    assert FigureFlags().figure_style.formats == ("png", "svg")
    assert FigureFlags(format=["pdf"]).figure_style.formats == ("pdf",)


def test_few_colours_make_a_smaller_file_that_is_the_same_each_time(tmp_path: Path) -> None:
    def written(style: Style, folder: str) -> bytes:
        (path,) = save({"a": drawn(style)}, tmp_path / folder, style)
        return path.read_bytes()

    docs = replace(DOCS, dpi=100.0)
    few = [written(docs, folder) for folder in ("one", "two")]
    assert few[0] == few[1]
    assert len(few[0]) < 0.6 * len(written(replace(docs, colors=None), "all"))


def test_who_waits_hears_of_each_file(tmp_path: Path) -> None:
    heard: list[float] = []
    save({"a": drawn(STYLES["screen"]), "b": drawn(STYLES["screen"])}, tmp_path, progress=heard.append)
    assert heard == [0.25, 0.5, 0.75, 1.0]


def test_writing_a_figure_leaves_it_to_be_laid_out_anew(tmp_path: Path) -> None:
    figure = drawn(STYLES["screen"])
    engine = figure.get_layout_engine()
    save({"a": figure}, tmp_path)
    assert figure.get_layout_engine() is engine


@pytest.mark.parametrize(
    ("flags", "expected"),
    [
        ({"format": ["jpg"]}, "format = jpg: expected one of png, svg, pdf"),
        ({"style": "poster"}, "style = poster: expected one of screen, paper, slides"),
        ({"width": "wide"}, "width = wide: expected single, double or millimetres, each from 20 to 2000 mm"),
        ({"size": "120"}, "size = 120: expected MMxMM, as in 120x80, each from 20 to 2000 mm"),
        ({"size": "120x80", "width": "90"}, "size: expected no width; the size includes the width"),
        ({"font_size": 0.0}, "font_size = 0: expected 1 to 100 points"),
    ],
)
def test_what_cannot_be_drawn_is_reported(flags: dict[str, Any], expected: str) -> None:
    with pytest.raises(UsageError, match=re.escape(expected)):
        FigureFlags(**flags)


def test_a_format_that_is_not_known_is_no_style() -> None:
    with pytest.raises(UsageError, match="format gif: expected one of png, svg, pdf"):
        Style(formats=("gif",))


def test_a_picture_is_as_sharp_after_any_other_format(tmp_path: Path) -> None:
    style = replace(STYLES["screen"], formats=("svg", "pdf", "png"), dpi=60.0)
    paths = save({"a": drawn(style)}, tmp_path, style)
    with Image.open(paths[-1]) as image:
        assert image.info["dpi"] == pytest.approx((60.0, 60.0), abs=0.1)
