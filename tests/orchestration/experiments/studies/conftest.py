"""Fixtures that the tests of sweeps share."""

from pathlib import Path
from typing import Any

import pytest

from tests.orchestration.experiments.studies.common import (
    NOISY,
    RUNS,
    bits,
    reference_store,
)


@pytest.fixture(scope="session")
def reference(tmp_path_factory: pytest.TempPathFactory) -> list[dict[str, Any]]:
    """The rows of the noisy study, run by one worker without interruption."""
    found = bits(reference_store(tmp_path_factory.mktemp("reference")))
    assert len(found) == RUNS
    return found


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder with the noisy study."""
    (tmp_path / "study.toml").write_text(NOISY)
    return tmp_path
