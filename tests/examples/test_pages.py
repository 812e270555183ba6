"""The commands on the pages of the examples work as written."""

import re
import shlex
from pathlib import Path

import pytest

from orchestration.systems.system.paths import value_at
from tests.commands import Main
from tests.examples.common import NAMES, example
from tests.extent import sample
from tests.places import EXAMPLES

PAGES = [*(EXAMPLES / name / "README.md" for name in NAMES), EXAMPLES.parent / "README.md"]
COMMANDS = [
    shlex.split(line, comments=True)
    for page in PAGES
    for line in page.read_text(encoding="utf-8").splitlines()
    if re.match(r"    quadcosim .*examples/", line)
]


def commands(name: str) -> list[list[str]]:
    """Each once, without `quadcosim`."""
    return [list(found) for found in dict.fromkeys(tuple(given[1:]) for given in COMMANDS if given[1] == name)]


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with nothing but the examples, as far as a reader's commands go."""
    (tmp_path / "examples").symlink_to(EXAMPLES)
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize("command", sample([*commands("run"), *commands("show"), *commands("build")], 3), ids=" ".join)
def test_a_command_that_is_shown_works(command: list[str], here: Path, main: Main) -> None:
    done = main(*command)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("command", commands("limit"), ids=" ".join)
def test_a_limit_that_is_asked_for_is_of_what_there_is(command: list[str]) -> None:
    file, options = command[1], dict(zip(command[2::2], command[3::2]))
    system = example(Path(file).parent.name)
    assert value_at(system, options["--of"]) is not None
    given = [setting.partition("=")[0] for option, setting in zip(command[2::2], command[3::2]) if option == "--set"]
    assert all(value_at(system, path) is not None for path in given)


def test_the_python_of_the_page_on_systems_works(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(EXAMPLES.parent)
    page = (EXAMPLES.parent / "docs" / "systems.md").read_text(encoding="utf-8")
    (shown,) = re.findall(r"```python\n(.*?)```", page, re.DOTALL)
    exec(shown, {})
    assert capsys.readouterr().out.startswith("2.49")
