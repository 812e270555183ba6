"""An SSP is run by the installed masters as it is written, and refusals are reported."""

import json
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

import pytest

from orchestration.simulation.interop.catalogue import TOOLS
from orchestration.simulation.interop.reading_back import READERS
from tests.commands import Main
from tests.places import EXAMPLES

NAMES = [f"{name.removesuffix(', SSP')} {version(TOOLS[name].packages[0])}" for name in READERS]


def test_each_master_that_is_installed_says_that_it_flies_a_system(tmp_path: Path, main: Main) -> None:
    done = main("ssp", EXAMPLES / "double_integrator" / "system.toml", "--read-back", "--out", tmp_path / "loop.ssp")
    assert done.stderr.splitlines()[-3:] == [f"{name} runs it" for name in NAMES]
    assert [name.partition(" ")[0] for name in NAMES] == ["libcosim", "ecos", "fmpy"]


def test_what_a_master_does_not_take_is_said_by_it(tmp_path: Path, main: Main) -> None:
    """A Boolean that feeds a Real: which of them refuse it is what the command warns of by itself."""
    done = main(
        "ssp", "-q", "--json", EXAMPLES / "water_tank" / "system.toml", "--read-back", "--out", tmp_path / "a.ssp"
    )
    found = json.loads(done.stdout)["masters"]
    assert [*found] == NAMES
    assert [refusal is None for refusal in found.values()] == [False, False, True]
    assert "Incompatible connector types" in found[NAMES[1]]
    for name, refusal in found.items():
        assert (f"warning: {name} does not run it: {refusal}" in done.stderr.splitlines()) is (refusal is not None)


def test_nothing_is_flown_where_nobody_asks_and_what_is_not_installed_is_left_out(
    tmp_path: Path, main: Main, monkeypatch: pytest.MonkeyPatch
) -> None:
    def nowhere(package: str) -> str:
        raise PackageNotFoundError(package)

    command = ("ssp", "--json", EXAMPLES / "double_integrator" / "system.toml", "--out", tmp_path / "loop.ssp")
    assert json.loads(main(*command).stdout)["masters"] == {}
    monkeypatch.setattr("importlib.metadata.version", nowhere)
    assert json.loads(main(*command, "--read-back").stdout)["masters"] == {}
