"""An FMU that turns on its own process fails its own runs; a sweep goes on, and believes nothing that it writes."""

import pickle
import struct
from pathlib import Path

import pytest

from orchestration.experiments.studies.axes import Axis
from orchestration.experiments.studies.store import open_for_reading
from orchestration.experiments.studies.study import Study
from orchestration.foundation.processes.resource_limits import own_limits
from orchestration.foundation.processes.typed_frames import pack
from orchestration.simulation.workers.row import Outcome, Results
from orchestration.simulation.workers.task import EnvironmentFailure
from orchestration.systems.system.component import Component
from orchestration.systems.system.model import System
from tests.orchestration.components.fmi.small import needs_compiler, small
from tests.orchestration.experiments.studies.common import sweep

GAIN = "components.it.parameters.gain"
NOTHING, EXITS, PICKLE, ROW, ENVIRONMENT, FILES, MEMORY, AFTER = map(float, range(1, 9))
"""Gains at which the FMU does nothing, ends its process, writes a frame, or lowers a limit"""
NO_MESSAGE = "it was ended: it sends what is no message of quadcosim"
FAILED = {
    EXITS: "the process of the run ended with exit code 0, in a call of it (Small), after t = 0.05 s of 0.1 s",
    PICKLE: NO_MESSAGE,
    ROW: NO_MESSAGE,
    ENVIRONMENT: NO_MESSAGE,
}
"""Messages of the rows that fail, by gain, but for that of a lack of memory"""


class _Evil:
    def __init__(self, made: Path) -> None:
        self._made = made

    def __reduce__(self) -> tuple[object, ...]:
        return Path.mkdir, (self._made,)


def hostile(folder: Path, *, forged: bool = False, more: str = "") -> Study:
    """The study of an FMU that is hostile at most of its gains; a folder `made` is that of a pickle that was loaded.

    `more` is what it does besides, before.
    """
    contents = {
        PICKLE: pickle.dumps(_Evil(folder / "made")),
        ROW: pack(Results.of([Outcome(metrics={"last": 7.0}, message=None, engine="compiled")])),
        ENVIRONMENT: pack(EnvironmentFailure(message="No space left on device")),
    }
    for gain, content in contents.items():
        (folder / f"{gain:.0f}").write_bytes(struct.pack("<Q", len(content)) + content)
    writes = (
        f'char name[999], b[9999]; snprintf(name, 999, "{folder}/%d", (int)m->s.gain);'
        ' FILE *f = fopen(name, "rb"); if (f) { int n = fread(b, 1, 9999, f);'
        " for (int d = 3; d < 64; d++) if (write(d, b, n)) {} fclose(f); sleep(9); }"
    )
    lowers = (
        f"struct rlimit r = {{0, 0}}; if (m->s.gain == {FILES}) setrlimit(RLIMIT_FSIZE, &r);"
        f" if (m->s.gain == {MEMORY}) {{ setrlimit(RLIMIT_AS, &r); setrlimit(RLIMIT_DATA, &r); }}"
    )
    fmu = small(folder, f"ENDS={more} if (m->s.gain == {EXITS}) exit(0); {writes} {lowers}", forged=forged)
    system = System(
        stop_time=0.1, components={"it": Component(fmu=str(fmu), step=0.01)}, objectives={"last": "max(it.y)"}
    )
    gains = (NOTHING, EXITS, PICKLE, ROW, ENVIRONMENT, FILES, MEMORY, AFTER)
    return Study(name="hostile", base=system, axes=(Axis(name=GAIN, targets=(GAIN,), values=gains),))


def expect_its_own_runs_to_fail(path: Path, folder: Path) -> None:
    """The rows of the study: those in which it is hostile, except that limits of files are set again, have failed."""
    with open_for_reading(path) as store:
        rows = {found["settings"][GAIN]: found for found in store.rows()}
    failed = {gain: found["message"] for gain, found in rows.items() if found["status"] == "failed"}
    # What lacks first is not determined: memory of its process, a thread, or nothing if the rest of the run has enough.
    lack = failed.pop(MEMORY, "can't start new thread")
    assert lack.endswith((", 3 times, each in a new process", "can't start new thread")), lack
    assert failed == FAILED
    assert {found["last"] for found in rows.values() if found["status"] == "done"} == {0.0}
    assert len(rows) == 8
    assert not (folder / "made").exists(), "expected no pickle of its process to be loaded"


@needs_compiler
@pytest.mark.parametrize("forged", [False, True], ids=["no hash", "a forged hash"])
def test_a_hostile_fmu_fails_its_own_runs_and_no_other(forged: bool, tmp_path: Path) -> None:
    before = own_limits()
    found = sweep(hostile(tmp_path, forged=forged), out=tmp_path / "out", workers=2, progress=None, announce=None)
    expect_its_own_runs_to_fail(found.path, tmp_path)
    assert own_limits() == before
