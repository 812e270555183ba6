"""What the texts of the repository must not say again, and what their examples do."""

import json
import re
import shlex
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import quadcosim
from orchestration.command.cli import main
from tests.places import ROOT

SOURCES = (*(ROOT / "controller_fmu").rglob("*"), *(ROOT / "fmu_kit").rglob("*"))
TEXTS = (
    ROOT / "README.md",
    *sorted((ROOT / "docs").rglob("*.md")),
    *sorted((ROOT / "docs").glob("make_*.py")),
    ROOT / "fmus" / "README.md",
    *sorted((ROOT / "studies").glob("*.toml")),
    *(path for path in SOURCES if path.suffix in (".py", ".h", ".html")),
)
ONE_WEIGHT_OF_THE_PROOF = re.compile(
    r"proof\s+(needs|asks\s+for\s+κ|does\s+not\s+go)|\(the\s+lyapunov\s+proof\)|\(lyapunov\s+proof\)|weight\s+of\s+the\s+proof",
    re.IGNORECASE,
)


def test_the_observer_of_the_page_of_controllers_follows_an_angle_that_moves_evenly() -> None:
    page = (ROOT / "docs/own_controller.md").read_text(encoding="utf-8")
    (block,) = (each for each in re.findall(r"```python\n(.*?)```", page, re.S) if "class Watching" in each)
    made: dict[str, Any] = {}
    exec(block, made)
    watching = made["Watching"](instance_name="one")
    for k in range(200):
        watching.angle = 2.0 + 0.3 * 0.01 * k
        watching.step(0.01 * k, 0.01)
    assert watching.rate == pytest.approx(0.3, rel=1e-9)
    assert watching.near == pytest.approx(watching.angle, rel=1e-9)


def test_the_lqg_of_the_page_of_python_has_the_poles_and_the_limit_that_it_says(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("control")
    shutil.copytree(ROOT / "examples/dc_servo", tmp_path / "examples/dc_servo")
    monkeypatch.chdir(tmp_path)
    page = (ROOT / "docs/python.md").read_text(encoding="utf-8").split("### LQG with a delay")[1].split("\n## ")[0]
    made: dict[str, Any] = {"np": np, "quadcosim": quadcosim}
    for file, text in re.findall(r"```python ?(\S*)\n(.*?)```", page, re.S):
        if file:
            Path(file).write_text(text, encoding="utf-8")
        else:
            exec(text, made)
    agree, limit = capsys.readouterr().out.split()
    assert (agree, len(made["designed"])) == ("True", 4)
    assert float(limit) == pytest.approx(0.028, abs=1e-5)


def test_no_text_says_that_the_proof_needs_one_coupling() -> None:
    """The energy has its rate for every κ: `test_energy_has_the_rate_of_the_proof_for_every_weight`."""
    texts = {path.relative_to(ROOT): path.read_text(encoding="utf-8") for path in TEXTS}
    assert not [path for path, text in texts.items() if ONE_WEIGHT_OF_THE_PROOF.search(text)]


def outcome(capsys: pytest.CaptureFixture[str], *arguments: str) -> str:
    with pytest.raises(SystemExit) as ended:
        main([*arguments, "--stop-time", "15", "--native", "--json"])
    assert not ended.value.code
    return str(json.loads(capsys.readouterr().out)["outcome"])


def test_limit_of_the_first_flight_is_that_of_one_start(capsys: pytest.CaptureFixture[str]) -> None:
    """From the farther start, the period that the paper's own start stands is too long; without coupling it is not."""
    page = (ROOT / "docs" / "start.md").read_text(encoding="utf-8")
    (line,) = re.findall(r"^    quadcosim (run --period 0.04 .*initial.*)$", page, re.M)
    command = shlex.split(line)
    assert outcome(capsys, *command) == "diverged"
    assert outcome(capsys, *command, "--period", "0.07") == "diverged"
    assert outcome(capsys, *command, "--period", "0.07", "--set", "controller.coupling=0") == "settled"
    assert outcome(capsys, "run", "--period", "0.07", "--plant-interval", "0.002") == "settled"
