"""What of an FMU lies on the disk while it runs."""

import tempfile
from pathlib import Path

import pytest

from orchestration.building import fmus
from orchestration.fmi.instances import open_instance


@pytest.mark.parametrize("fmu", ["QuadrotorPlant", "native/QuadrotorPlant"])
def test_what_is_for_readers_is_not_unpacked_to_run_an_fmu(
    fmu: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    with open_instance(fmus.locate(fmu), "plant"):
        (folder,) = tmp_path.iterdir()
        unpacked = {path.name for path in folder.iterdir()}
    assert {"modelDescription.xml", "binaries", "resources"} <= unpacked
    assert not {"documentation", "sources"} & unpacked
