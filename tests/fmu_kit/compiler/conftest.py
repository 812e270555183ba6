"""Where programs for other systems run."""

import os
from collections.abc import Iterator

import pytest


@pytest.fixture(scope="package", autouse=True)
def wine(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Wine prints nothing, and has one folder for the tests of all processes: making it takes seconds."""
    shared = tmp_path_factory.getbasetemp()
    if "PYTEST_XDIST_WORKER" in os.environ:
        shared = shared.parent
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("WINEPREFIX", str(shared / "wine"))
        patch.setenv("WINEDEBUG", "-all")
        yield
