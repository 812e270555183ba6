"""A library is compiled once: the same sources, options and compiler find it in the user's cache."""

from pathlib import Path

import pytest

from fmu_kit import libraries

SOURCES = {"a.c": b"int a;", "a.h": b"extern int a;"}


class Compiler:
    """Counts what it is asked to compile."""

    def __init__(self) -> None:
        self.calls = 0

    def __call__(self) -> bytes:
        self.calls += 1
        return b"library %d" % self.calls


@pytest.fixture
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The user's cache, which is empty."""
    monkeypatch.setattr("platformdirs.user_cache_dir", lambda name: str(tmp_path / name))
    return tmp_path / "quadcosim"


def test_what_was_compiled_is_kept_and_found_by_its_content(cache: Path) -> None:
    compiler = Compiler()
    assert [libraries.cached_content("made", SOURCES, "-O2", compiler) for _ in range(3)] == [b"library 1"] * 3
    path = libraries.cached_library("made", dict(reversed(SOURCES.items())), "-O2", compiler)
    assert path.read_bytes() == b"library 1"
    assert [*cache.rglob("*.*")] == [path]


@pytest.mark.usefixtures("cache")
def test_another_source_option_compiler_or_processor_is_another_library(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    compiler = Compiler()
    for sources, how in ((SOURCES, "-O2"), (SOURCES, "-O1"), ({**SOURCES, "a.c": b"int a = 1;"}, "-O2")):
        libraries.cached_content("made", sources, how, compiler)
    (tmp_path / "cc").touch()
    monkeypatch.setattr("shutil.which", lambda name: str(tmp_path / name))
    assert libraries.cached_content("made", SOURCES, "-O2", compiler) == b"library 4"
    monkeypatch.setattr(libraries, "processor", lambda: ("x86_64", "flags : fpu"))
    assert libraries.cached_content("made", SOURCES, "-O2", compiler) == b"library 5"


def test_where_nothing_can_be_kept_it_is_compiled_each_time(cache: Path) -> None:
    cache.write_text("no folder")
    compiler = Compiler()
    assert [libraries.cached_content("made", SOURCES, "-O2", compiler) for _ in range(2)] == [
        b"library 1",
        b"library 2",
    ]
    with pytest.raises(OSError, match="quadcosim"):
        libraries.cached_library("made", SOURCES, "-O2", compiler)
