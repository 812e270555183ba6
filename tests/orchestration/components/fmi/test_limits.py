"""What a file asks for beyond a limit is refused before memory or disk is taken."""

import zipfile
from pathlib import Path

import pytest

from docs import make_limits
from orchestration.components.fmi.read_description import read_model
from orchestration.foundation.basics.errors import UsageError
from orchestration.foundation.processes import resource_limits
from orchestration.foundation.processes.resource_limits import FileLimit
from orchestration.simulation.requests.ssp.document import Package, open_package
from tests.orchestration.components.fmi.small import needs_compiler, small

SQUARE = """<Float64 name="A" valueReference="9" causality="local"><Dimension start="100000"/>
<Dimension start="100000"/></Float64>"""


@needs_compiler
def test_arrays_of_more_elements_than_memory_are_refused(tmp_path: Path) -> None:
    path = small(tmp_path, fmi=3, more=SQUARE)
    with pytest.raises(UsageError, match=r"small.fmu: its arrays have 10000000004 elements: expected at most 100000$"):
        read_model(path)


def declaring(path: Path, name: str, megabytes: int) -> Path:
    """An archive of a few MB whose file unpacks to so many."""
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive, archive.open(name, "w") as file:
        for _ in range(megabytes):
            file.write(bytes(1_000_000))
    return path


def test_an_ssp_that_would_fill_the_cache_is_not_unpacked(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.setattr(resource_limits, "UNPACKED", FileLimit(2.0, "MB", ""))
    with pytest.raises(UsageError, match=r"unpacks to 3 MB, .* times its size: expected at most 2 MB, or 20 times its"):
        open_package(declaring(tmp_path / "large.ssp", "resources/zeros", 3))
    assert not list((tmp_path / "cache").rglob("zeros"))


def test_a_description_that_would_fill_the_memory_is_not_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(resource_limits, "DESCRIPTION", FileLimit(2.0, "MB", ""))
    with pytest.raises(UsageError, match=r"modelDescription.xml has 3 MB: expected at most 2 MB$"):
        read_model(declaring(tmp_path / "large.fmu", "modelDescription.xml", 3))


@pytest.mark.parametrize(
    "source", ["../outside.fmu", "/outside.fmu", "file:///etc/passwd", "https://example.org/x.fmu"]
)
def test_a_source_outside_of_an_ssp_is_refused(source: str, tmp_path: Path) -> None:
    (tmp_path / "outside.fmu").touch()
    package = Package(structure=tmp_path / "inside" / "SystemStructure.ssd")
    with pytest.raises(UsageError, match=r"expected a file of the SSP$"):
        package.file(source)


def test_the_page_has_the_limits_that_there_are() -> None:
    assert make_limits.table() in make_limits.PAGE.read_text(encoding="utf-8")
