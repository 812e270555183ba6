"""Which version an FMU carries."""

import importlib.metadata
from pathlib import Path
from xml.etree.ElementTree import fromstring

import pytest

from fmu_kit import packaging
from fmu_kit.bundle import Target
from fmu_kit.versions import generation_tool, project_version, version_of
from plant_fmu.slave import QuadrotorPlant
from tests.fmus.archive import files_of


class Foreign:
    """A slave without a version."""


class Versioned(Foreign):
    version = "2.5"


def test_a_slave_of_this_project_has_its_version_and_others_only_their_own() -> None:
    assert version_of(QuadrotorPlant) == project_version()
    assert version_of(Foreign) is None
    assert version_of(Versioned) == "2.5"


def test_an_fmu_is_out_of_date_after_another_version_is_installed(monkeypatch: pytest.MonkeyPatch) -> None:
    target = Target("plant_fmu.slave", "QuadrotorPlant")
    before = packaging.source_hash(target)
    assert packaging.source_hash(target) == before
    monkeypatch.setattr(packaging, "generation_tool", lambda: "quadcosim 99.0")
    assert packaging.source_hash(target) != before


def test_the_description_says_the_version_that_a_slave_says(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(QuadrotorPlant, "version", "3.1.4", raising=False)
    path = packaging.build(Target("plant_fmu.slave", "QuadrotorPlant"), tmp_path)
    root = fromstring(files_of(path)["modelDescription.xml"])
    assert root.get("version") == "3.1.4"
    assert root.get("generationTool") == generation_tool() == f"quadcosim {importlib.metadata.version('quadcosim')}"
