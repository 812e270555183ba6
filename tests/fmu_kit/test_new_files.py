"""A file appears whole or not at all, and an old one survives whatever fails; nothing else is left."""

import errno
import os
import subprocess
import sys
import threading
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import pytest

from fmu_kit import new_files as module
from fmu_kit.new_files import WriteError, new_file, new_files, write_atomically

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="folders have no locks there")

OLD, NEW = {"model.c": "old c", "model.h": "old h"}, {"model.c": "new c", "model.h": "new h"}


def contents(folder: Path) -> dict[str, str]:
    return {path.relative_to(folder).as_posix(): path.read_text() for path in folder.rglob("*") if path.is_file()}


def write(folder: Path, files: dict[str, str]) -> None:
    with new_files(folder) as new:
        for name, text in files.items():
            write_atomically(new / name, text)


@pytest.fixture(params=[{}, OLD], ids=["nothing there", "old files there"])
def before(request: pytest.FixtureRequest, tmp_path: Path) -> dict[str, str]:
    """The files of the folder before the failure."""
    for name, text in request.param.items():
        (tmp_path / name).write_text(text)
    return dict(request.param)


def nth_fails(monkeypatch: pytest.MonkeyPatch, name: str, n: int) -> None:
    """The `n`-th call of a function of the operating system fails as on a full disk."""
    genuine: Callable[..., None] = getattr(os, name)
    calls = iter(range(1, 1000))

    def fail(*arguments: object, **named: object) -> None:
        if next(calls) == n:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(arguments[0]) if name == "replace" else None)
        genuine(*arguments, **named)

    monkeypatch.setattr(os, name, fail)


def calls_of(name: str, files: dict[str, str], tmp_path: Path) -> int:
    """The number of calls of a function of the operating system by which files are written."""
    with pytest.MonkeyPatch.context() as patch:
        counted: list[object] = []
        (tmp_path / "counted").mkdir()
        genuine = getattr(os, name)

        def count(*arguments: object, **named: object) -> None:
            counted.append(arguments)
            genuine(*arguments, **named)

        patch.setattr(os, name, count)
        write(tmp_path / "counted", files)
    return len(counted)


@pytest.mark.parametrize("new", [NEW, {"model.c": "new c"}], ids=["a set", "one file"])
@pytest.mark.parametrize("name", ["replace", "fsync", "rename"])
def test_whichever_call_fails_the_set_is_as_it_was_and_nothing_is_left(
    name: str, new: dict[str, str], before: dict[str, str], tmp_path: Path
) -> None:
    folder = tmp_path / "out"
    folder.mkdir()
    for each, text in before.items():
        (folder / each).write_text(text)
    count = calls_of(name, new, tmp_path)
    assert count > 0
    for n in range(1, count + 1):
        with pytest.MonkeyPatch.context() as patch:
            nth_fails(patch, name, n)
            with pytest.raises(WriteError, match=r"out.*: could not be written: No space left on device$"):
                write(folder, new)
        assert contents(folder) == before
        assert {path.name for path in folder.iterdir()} == set(before)
    write(folder, new)
    assert contents(folder) == {**before, **new}


def test_where_no_folder_can_be_made_nothing_is_left(tmp_path: Path) -> None:
    for n in range(1, 4):
        with pytest.MonkeyPatch.context() as patch:
            nth_fails(patch, "mkdir", n)
            with pytest.raises(WriteError, match=r"out: could not be written: No space left on device$"):
                write(tmp_path / "out", NEW)
        assert not any(tmp_path.iterdir())


def test_what_the_block_raises_leaves_all_as_it_was(before: dict[str, str], tmp_path: Path) -> None:
    with suppress(KeyboardInterrupt), new_files(tmp_path) as new:
        (new / "model.c").write_text("half")
        raise KeyboardInterrupt
    assert contents(tmp_path) == before
    assert {path.name for path in tmp_path.iterdir()} == set(before)


def test_a_file_of_a_set_that_fails_is_not_left_half(before: dict[str, str], tmp_path: Path) -> None:
    with new_files(tmp_path) as new:
        (new / "model.c").write_text("new")
        with suppress(ZeroDivisionError), new_file(new / "model.h") as header:
            header.write_text("half")
            raise ZeroDivisionError
        with suppress(ZeroDivisionError), new_files(new) as folder:
            (folder / "other.c").write_text("half")
            raise ZeroDivisionError
    assert contents(tmp_path) == {**before, "model.c": "new"}


def test_an_error_of_something_else_is_not_blamed_on_the_file(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match=r"No such file or directory: '/missing'"), new_files(tmp_path):
        Path("/missing").read_text()
    with pytest.raises(BrokenPipeError), new_files(tmp_path):
        raise BrokenPipeError(errno.EPIPE, "Broken pipe")


FULL = """
import resource, sys
from pathlib import Path
from fmu_kit.new_files import new_file, write_atomically
sys.dont_write_bytecode = True  # else half of it would be kept
resource.setrlimit(resource.RLIMIT_FSIZE, (1000, 1000))
try:
    write_atomically(Path(sys.argv[1]), "x" * 5000)
except OSError as error:
    print(error)
import pyarrow as pa
from pyarrow import parquet
try:
    with new_file(Path(sys.argv[1])) as new:
        parquet.write_table(pa.table({"a": [float(i) ** 0.5 for i in range(1000)]}), new)
except OSError as error:
    print(error)
"""


def test_a_file_that_grows_too_large_is_named_and_the_old_one_kept(before: dict[str, str], tmp_path: Path) -> None:
    path = tmp_path / "model.c"
    done = subprocess.run([sys.executable, "-c", FULL, str(path)], capture_output=True, text=True, check=True)
    assert done.stdout == f"{path}: could not be written: File too large\n" * 2
    assert contents(tmp_path) == before


def test_where_nothing_may_be_written_the_reason_is_said(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The superuser may write everywhere, so the system's answers are made here."""
    write(tmp_path, OLD)
    with monkeypatch.context() as patch:
        patch.setattr(os, "access", lambda path, mode: Path(path).name != "model.c")
        with pytest.raises(WriteError) as raised:
            write(tmp_path, NEW)
    assert str(raised.value) == f"{tmp_path / 'model.c'}: could not be written: Permission denied"

    def refuse(*_: object) -> None:
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))

    with monkeypatch.context() as patch:
        patch.setattr(os, "mkdir", refuse)
        with pytest.raises(WriteError) as raised:
            write(tmp_path, NEW)
    assert str(raised.value) == f"{tmp_path}: could not be written: Permission denied"
    assert contents(tmp_path) == OLD


def test_a_folder_is_not_replaced_and_not_a_place_for_a_file(tmp_path: Path) -> None:
    (tmp_path / "thesis").mkdir()
    with pytest.raises(WriteError, match=r"thesis: could not be written: Is a directory$"):
        write_atomically(tmp_path / "thesis", "text")
    with pytest.raises(WriteError, match=r"thesis: could not be written: File exists$"), new_files(tmp_path) as new:
        write_atomically(new / "thesis" / "file", "text")
    (tmp_path / "file").write_text("text")
    with pytest.raises(WriteError, match=r"file: could not be written: Not a directory$"):
        write_atomically(tmp_path / "file" / "below", "text")
    assert contents(tmp_path) == {"file": "text"}


def test_folders_made_for_a_file_that_is_not_written_are_removed(tmp_path: Path) -> None:
    with pytest.raises(KeyboardInterrupt), new_file(tmp_path / "a" / "b" / "file"):
        raise KeyboardInterrupt
    assert not any(tmp_path.iterdir())


KILLED = """
import os, sys
from pathlib import Path
from fmu_kit import new_files
genuine, names = os.replace, iter(range(1, 100))

def replace(*each):
    if next(names) == int(sys.argv[2]):
        os._exit(9)
    genuine(*each)

os.replace = replace
with new_files.new_files(Path(sys.argv[1])) as new:
    (new / "model.c").write_text("new c")
    if sys.argv[2] == "0":
        os._exit(9)
    (new / "model.h").write_text("new h")
"""


@pytest.mark.parametrize(("n", "first", "then"), [(0, OLD, OLD), (1, OLD, NEW), (2, OLD | {"model.c": "new c"}, NEW)])
def test_what_a_killed_process_began_the_next_one_removes_or_finishes(
    n: int, first: dict[str, str], then: dict[str, str], tmp_path: Path
) -> None:
    write(tmp_path, OLD)
    done = subprocess.run([sys.executable, "-c", KILLED, str(tmp_path), str(n)], check=False)
    assert done.returncode == 9
    assert {name: (tmp_path / name).read_text() for name in OLD} == first
    module._cleared.clear()
    write_atomically(tmp_path / "other", "text")
    assert contents(tmp_path) == {**then, "other": "text"}
    assert {path.name for path in tmp_path.iterdir()} == {*OLD, "other"}


LIVING = """
import sys
from pathlib import Path
from fmu_kit.new_files import new_files
with new_files(Path(sys.argv[1])) as new:
    (new / "theirs").write_text("text")
    print("writing", flush=True)
    input()
"""


def test_what_a_living_process_writes_is_left_alone(tmp_path: Path) -> None:
    command = [sys.executable, "-c", LIVING, str(tmp_path)]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as other:
        assert other.stdout is not None
        assert other.stdout.readline() == "writing\n"
        module._cleared.clear()
        write_atomically(tmp_path / "mine", "text")
        other.communicate("\n")
    assert contents(tmp_path) == {"mine": "text", "theirs": "text"}


def test_permissions_and_links_stay_and_a_pipe_receives_the_content(tmp_path: Path) -> None:
    path, link, pipe = tmp_path / "file", tmp_path / "link", tmp_path / "pipe"
    path.write_text("old")
    path.chmod(0o640)
    link.symlink_to(path)
    write_atomically(link, "new")
    assert link.is_symlink()
    assert path.read_text() == "new"
    assert path.stat().st_mode & 0o777 == 0o640
    os.mkfifo(pipe)
    writer = threading.Thread(target=write_atomically, args=(pipe, "text"))
    writer.start()
    assert pipe.read_text() == "text"
    writer.join()
    assert pipe.is_fifo()


def test_threads_may_write_the_same_at_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path, genuine = tmp_path / "kept.so", os.replace

    def replace(fresh: Path, target: Path) -> None:
        """Another thread writes it just before this one does."""
        monkeypatch.setattr(os, "replace", genuine)
        other = threading.Thread(target=write_atomically, args=(path, b"library"))
        other.start()
        other.join()
        genuine(fresh, target)

    monkeypatch.setattr(os, "replace", replace)
    write_atomically(path, b"library")
    assert contents(tmp_path) == {"kept.so": "library"}
