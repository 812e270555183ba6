"""Stations of the page "A run and a sweep, file by file" against the code that they quote."""

import re
import textwrap

import pytest

from tests.places import ROOT

PAGE = (ROOT / "docs" / "design" / "a_run_file_by_file.md").read_text(encoding="utf-8")
STATIONS = re.findall(
    r"^### (\d+\. [^\n]+)\n\n(.+?)\n\n`([^`\n]+)`\n\n```text\n(.+?)\n```$", PAGE, re.DOTALL | re.MULTILINE
)


def test_a_run_has_twelve_stations_and_a_sweep_eight() -> None:
    numbers = [int(title.partition(".")[0]) for title, *_ in STATIONS]
    assert numbers == [*range(1, 13), *range(1, 9)]


@pytest.mark.parametrize(("title", "_text", "path", "quoted"), STATIONS, ids=[title for title, *_ in STATIONS])
def test_lines_of_a_station_are_consecutive_lines_of_its_file(title: str, _text: str, path: str, quoted: str) -> None:
    lines, count = (ROOT / path).read_text(encoding="utf-8").splitlines(), quoted.count("\n") + 1
    parts = ("\n".join(lines[first : first + count]) for first in range(len(lines) - count + 1))
    assert any(textwrap.dedent(part) == quoted for part in parts), f"{path} no longer has the lines of {title}"
