"""Takes the screenshot of a report for its page, docs/figures/report.png. Needs Chromium."""

import io
import shutil
import sys
from pathlib import Path

from PIL import Image
from playwright.sync_api import sync_playwright

FIGURE = Path(__file__).parent / "figures" / "report.png"
COLORS = 128


def screenshot(report: Path) -> bytes:
    """The first screen of a report, with the run of the largest delay at 50 ms open at 7 s, as PNG."""
    browser = shutil.which("chromium") or "chromium"
    with sync_playwright() as started:
        window = started.chromium.launch(executable_path=browser, args=["--no-sandbox"])
        page = window.new_page(viewport={"width": 1400, "height": 880})
        page.goto(report.resolve().as_uri())
        page.wait_for_selector("body[data-drawn]")
        page.get_by_label("Run", exact=True).fill("121")
        page.get_by_label("Run", exact=True).press("Enter")
        page.get_by_label("Time", exact=True).fill("7")
        page.mouse.move(0, 0)
        page.wait_for_timeout(1000)
        page.evaluate("document.activeElement.blur()")
        picture: bytes = page.screenshot()
        window.close()
    return picture


def main() -> None:
    """Write the screenshot of the report at the given path."""
    image = Image.open(io.BytesIO(screenshot(Path(sys.argv[1]))))
    image.convert("P", palette=Image.Palette.ADAPTIVE, colors=COLORS).save(FIGURE, optimize=True)
    print(FIGURE)


if __name__ == "__main__":
    main()
