"""Settings and fixtures that all tests share."""

import os
from pathlib import Path

import hypothesis
import pytest

from orchestration import fmus
from orchestration.wiring import MODELS

hypothesis.settings.register_profile("ci", derandomize=True, deadline=None)
hypothesis.settings.register_profile("local", deadline=None)
hypothesis.settings.load_profile("ci" if os.environ.get("CI") else "local")

DATA = Path(__file__).parent / "data"


@pytest.fixture(scope="session")
def data() -> Path:
    """The folder of reference data."""
    return DATA


@pytest.fixture(scope="session")
def built(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Both FMUs by model name, freshly built into a folder of the session."""
    folder = tmp_path_factory.mktemp("fmus")
    return {path.stem: path for path in fmus.build(MODELS, folder)}
