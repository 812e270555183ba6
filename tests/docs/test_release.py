"""What makes a release: the same bytes from the same content, with sums that say so, over nothing that lay there."""

import hashlib
import io
import tarfile
from pathlib import Path

import pytest

from docs import make_release

CONTENT = {"project/README.md": b"# A project\n", "project/run.sh": b"#!/bin/sh\n", "project/empty.py": b""}


def packed(path: Path, names: list[str], time: int) -> Path:
    """An archive as a build leaves it: of some time and order, owned by someone."""
    with tarfile.open(path, "w:gz") as tar:
        folder = tarfile.TarInfo("project")
        folder.type, folder.mode, folder.mtime = tarfile.DIRTYPE, 0o775, time
        tar.addfile(folder)
        for name in names:
            entry = tarfile.TarInfo(name)
            entry.size, entry.mtime, entry.uid, entry.uname = len(CONTENT[name]), time, time % 1000, f"user{time}"
            entry.mode = 0o775 if name.endswith(".sh") else 0o664
            tar.addfile(entry, io.BytesIO(CONTENT[name]))
    return path


def test_sources_have_the_same_bytes_whenever_and_by_whomever_they_are_packed(tmp_path: Path) -> None:
    one = packed(tmp_path / "one.tar.gz", [*CONTENT], 1_000_000_001)
    other = packed(tmp_path / "other.tar.gz", [*reversed(CONTENT)], 1_200_000_002)
    assert one.read_bytes() != other.read_bytes()
    for archive in (one, other):
        make_release.normalise(archive, 1_100_000_000)
    assert one.read_bytes() == other.read_bytes()
    with tarfile.open(one) as tar:
        files = {entry.name: entry for entry in tar.getmembers()}
        for name, content in CONTENT.items():
            file = tar.extractfile(name)
            assert file is not None
            assert file.read() == content
    assert files["project"].isdir()
    assert {name: entry.mode for name, entry in files.items() if entry.isfile()} == {
        "project/README.md": 0o644, "project/run.sh": 0o755, "project/empty.py": 0o644,
    }  # fmt: skip
    assert {entry.mtime for entry in files.values()} == {1_100_000_000}


def test_sums_are_of_every_file_but_their_own(tmp_path: Path) -> None:
    (tmp_path / "b.whl").write_bytes(b"wheel")
    (tmp_path / "a.zip").write_bytes(b"zip")
    (tmp_path / make_release.SUMS).write_text("old")
    expected = [
        (hashlib.sha256(content).hexdigest(), name) for name, content in (("a.zip", b"zip"), ("b.whl", b"wheel"))
    ]
    assert [tuple(line.split("  ")) for line in make_release.sums(tmp_path).splitlines()] == expected


def test_a_folder_that_holds_something_is_not_released(tmp_path: Path) -> None:
    (tmp_path / "old.whl").touch()
    with pytest.raises(SystemExit, match="expected an empty folder"):
        make_release.main(tmp_path)
