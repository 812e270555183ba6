import os
import shutil
from collections.abc import Iterator
from typing import Any

import pytest

BROWSERS = ("chromium", "chromium-browser", "google-chrome", "chrome")


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    path = next((found for name in BROWSERS if (found := shutil.which(name)) is not None), None)
    if path is None:
        pytest.skip(f"none of {', '.join(BROWSERS)} is on this machine")
    from playwright.sync_api import sync_playwright

    with sync_playwright() as started:
        place = {**os.environ, "TMPDIR": "/tmp"}  # its sockets are in it, whose paths must be short
        opened = started.chromium.launch(executable_path=path, args=["--no-sandbox"], env=place)
        yield opened
        opened.close()
