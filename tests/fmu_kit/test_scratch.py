"""Temporary folders of killed processes are removed when the next process starts."""

import errno
import subprocess
import sys
from pathlib import Path

import fmpy
import pytest

from fmu_kit import scratch
from fmu_kit.compiler.pack import c_compiler
from orchestration.components.fmi.fmi2 import Fmi2Instance
from orchestration.foundation.basics.errors import QuadcosimError

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="folders have no locks there")

WAITER = """
import sys, time
from orchestration.components.fmi.fmi2 import Fmi2Instance
from pathlib import Path
fmu = Fmi2Instance(Path(sys.argv[1]), "plant")
print("loaded", flush=True)
time.sleep(6000)
"""


def start(fmu: Path) -> subprocess.Popen[str]:
    """Another process that has loaded an FMU."""
    process = subprocess.Popen([sys.executable, "-c", WAITER, str(fmu)], stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    assert process.stdout.readline() == "loaded\n"
    return process


def test_fmus_unpacked_by_killed_processes_are_removed_and_those_of_running_ones_are_not(
    built: dict[str, Path], temporary: Path
) -> None:
    with start(built["QuadrotorPlant"]) as killed:
        (left,) = temporary.iterdir()
        with start(built["QuadrotorPlant"]) as living:
            (used,) = set(temporary.iterdir()) - {left}
            killed.kill()
            killed.wait()
            assert list((left / "resources").iterdir())
            (temporary / "thesis.scratch").mkdir()
            mine = scratch.temporary()
            assert set(temporary.iterdir()) == {used, mine.path, temporary / "thesis.scratch"}
            assert list((used / "resources").iterdir())
            mine.remove()
            living.kill()
    assert not mine.path.exists()


def test_others_cannot_enter_it(temporary: Path) -> None:
    folder = scratch.temporary()
    assert folder.path.stat().st_mode & 0o777 == 0o700
    folder.remove()


def test_no_space_to_unpack_is_reported_with_the_folder(
    built: dict[str, Path], temporary: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: object, **__: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(fmpy, "extract", full)
    with pytest.raises(QuadcosimError) as raised:
        Fmi2Instance(built["QuadrotorPlant"], "plant")
    expected = f"cannot be unpacked in {temporary}, which TMPDIR names: No space left on device"
    assert str(raised.value) == f"{built['QuadrotorPlant']}: {expected}"
    assert not list(temporary.iterdir())


def test_a_folder_without_an_owner_is_removed_and_one_taken_for_such_is_made_again(
    temporary: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A process may be killed, or overtaken by one that clears, between making its folder and locking it."""
    left = temporary / "quadcosim-left.scratch"
    left.mkdir()
    lock, first = scratch._locked, iter([True])

    def overtaken(folder: Path, *, wait: bool) -> int | None:
        if wait and next(first, False):
            folder.rmdir()
        return lock(folder, wait=wait)

    monkeypatch.setattr(scratch, "_locked", overtaken)
    with scratch.temporary_folder() as folder:
        assert [*temporary.iterdir()] == [folder]
        (folder / "file").write_text("text")
    assert not any(temporary.iterdir())


def test_what_a_compiler_keeps_for_itself_is_in_such_a_folder(temporary: Path) -> None:
    command = ["sh", "-c", 'printf %s "$TMPDIR" > library']
    assert Path(c_compiler._compiled(command, {}, "main.c").decode()).parent == temporary
    assert not any(temporary.iterdir())
