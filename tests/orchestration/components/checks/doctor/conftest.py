"""What the tests of `doctor` look at: FMUs as pythonfmu's own builder makes them, most of all that there are."""

from pathlib import Path

import pytest

from tests.fmus.archive import without_loader


@pytest.fixture(scope="session")
def built(built: dict[str, Path], tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Both FMUs by model name, without the loader of this project."""
    folder = tmp_path_factory.mktemp("plain")
    return {name: without_loader(fmu, folder) for name, fmu in built.items()}
