"""A run that exceeds its time limit fails with the reason; the others are run."""

import sys
from pathlib import Path

import pytest

from orchestration.experiments.studies.axes import Axis
from orchestration.experiments.studies.store import open_for_reading
from orchestration.experiments.studies.study import Study
from orchestration.systems.system.component import Component
from orchestration.systems.system.model import System
from tests.commands import Main
from tests.extent import sample
from tests.orchestration.components.fmi.small import known, needs_compiler, small
from tests.orchestration.experiments.studies.common import sweep

pytestmark = [needs_compiler, pytest.mark.skipif(sys.platform != "linux", reason="/proc of Linux")]

GAIN = "components.it.parameters.gain"
STUDY = f"""\
scenario = "system.toml"
[[axes]]
name = "gain"
sets = ["{GAIN}"]
values = [1.0, 3.0, 2.0]
"""
SYSTEM = """\
stop_time = 0.1
[objectives]
last = "max(it.y)"
[components.it]
fmu = "small.fmu"
step = 0.01
"""


@pytest.mark.parametrize("waits", sample(["for (;;)", "for (;;) usleep(1000)"], 1))
def test_a_run_that_hangs_is_a_failed_row_with_the_reason(waits: str, tmp_path: Path) -> None:
    path = known(small(tmp_path, f"ENDS=if (m->s.gain == 3.0) {waits}"))
    system = System(
        stop_time=0.1, components={"it": Component(fmu=str(path), step=0.01)}, objectives={"last": "max(it.y)"}
    )
    study = Study(name="hangs", base=system, axes=(Axis(name=GAIN, targets=(GAIN,), values=(1.0, 3.0, 2.0)),))
    found = sweep(study, out=tmp_path / "out", time_limit=1.0, progress=None, announce=None)
    assert (found.total, found.flown, found.failed) == (3, 3, 1)
    with open_for_reading(found.path) as store:
        rows = {row["design_index"]: (row["status"], row["message"]) for row in store.rows()}
    assert rows == {
        0: ("done", None),
        1: ("failed", "it was ended: it takes more than the time limit of 1 s"),
        2: ("done", None),
    }


def test_the_command_limits_each_run(tmp_path: Path, main: Main) -> None:
    known(small(tmp_path, "ENDS=if (m->s.gain == 3.0) for (;;) usleep(1000)"))
    (tmp_path / "system.toml").write_text(SYSTEM)
    (tmp_path / "study.toml").write_text(STUDY)
    done = main(
        "sweep", tmp_path / "study.toml", "--out", tmp_path / "out", "--time-limit", "1", "--engine", "compiled", code=1
    )
    assert "failed: it was ended: it takes more than the time limit of 1 s" in done.stderr
    assert "3 runs, 3 of them new, 1 failed" in done.stdout
    done = main("sweep", tmp_path / "study.toml", "--out", tmp_path / "out", "--time-limit", "-1", code=2)
    assert done.stderr == "quadcosim: --time-limit -1: expected a positive number of seconds\n"
