"""Takes the screenshots of the pages: docs/figures/report.png of a report, docs/figures/live.png of the page that runs.

`python -m docs.make_screenshots report FILE.html`, `python -m docs.make_screenshots live FILE.html`. Needs Chromium.
"""

import io
import shutil
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

from PIL import Image
from playwright.sync_api import sync_playwright

FIGURES = Path(__file__).parent / "figures"
COLORS = 128


def report(page: Any) -> None:
    """The run of the largest delay at 50 ms, open at 7 s."""
    page.get_by_label("Run", exact=True).fill("121")
    page.get_by_label("Run", exact=True).press("Enter")
    page.get_by_label("Time", exact=True).fill("7")
    page.mouse.move(0, 0)
    page.wait_for_timeout(1000)
    page.evaluate("document.activeElement.blur()")


def live(page: Any) -> None:
    """Two laws at 79 ms, and the whole map."""
    page.get_by_text("576 of 576 runs").wait_for(timeout=600_000)


SHOTS: dict[str, tuple[str, Callable[[Any], None]]] = {
    "report": ("", report),
    "live": ("#timing.period=0.079&second&second.controller.coupling=0", live),
}
"""Ends of addresses, and preparations, by picture"""


def screenshot(name: str, file: Path) -> bytes:
    """The first screen of a page, as PNG."""
    at, prepare = SHOTS[name]
    browser = shutil.which("chromium") or "chromium"
    with sync_playwright() as started:
        window = started.chromium.launch(executable_path=browser, args=["--no-sandbox"])
        page = window.new_page(viewport={"width": 1400, "height": 880})
        page.goto(file.resolve().as_uri() + at)
        page.wait_for_selector("body[data-drawn]")
        prepare(page)
        picture: bytes = page.screenshot()
        window.close()
    return picture


def main(name: str, file: str) -> None:
    """Write the screenshot of the page in a file."""
    image = Image.open(io.BytesIO(screenshot(name, Path(file))))
    figure = FIGURES / f"{name}.png"
    image.convert("P", palette=Image.Palette.ADAPTIVE, colors=COLORS).save(figure, optimize=True)
    print(figure)


if __name__ == "__main__":
    main(*sys.argv[1:3])
