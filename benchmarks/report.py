"""The size of the report of a large study, and the time in which a browser opens it.

python -m benchmarks.report            10,000 runs, in SIMD lanes of native FMUs; needs Chromium
"""

import argparse
import shutil
import statistics
import tempfile
import time
from pathlib import Path
from typing import Any

from orchestration.experiments.report.writing import report
from orchestration.experiments.studies.study_file import load_study
from orchestration.experiments.studies.sweep import sweep

STUDY = """
name = "big"
[base.timing]
plant_interval = 0.005
[base.plant]
max_internal_step = 0.005
[[axes]]
name = "period"
sets = ["timing.period"]
start = 0.005
stop = 0.1
number = {side}
[[axes]]
name = "delay"
sets = ["timing.delay"]
start = 0.0
stop = 0.06
number = {side}
"""
TIMES = """({
    parsed: performance.getEntriesByType("navigation")[0].domContentLoadedEventEnd,
    drawn: performance.getEntriesByName("first plot")[0].startTime,
})"""
OPENINGS = 7


def write_report(side: int, folder: Path) -> Path:
    """Write the report of a study of side x side runs, and print how long it took."""
    file = folder / "study.toml"
    file.write_text(STUDY.format(side=side), encoding="utf-8")
    started = time.perf_counter()
    summary = sweep(load_study(file), out=folder, engine="batch")
    swept = time.perf_counter()
    out = report(file, out=folder)
    print(f"{summary.total} runs in {swept - started:.1f} s, report written in {time.perf_counter() - swept:.1f} s")
    return out


def opening_times(file: Path, browser: str) -> list[dict[str, float]]:
    """Times from the start of loading to the parsed page and to the first plot [ms], each in a new page."""
    from playwright.sync_api import sync_playwright

    found = []
    with sync_playwright() as started:
        window: Any = started.chromium.launch(executable_path=browser, args=["--no-sandbox"])
        for _ in range(OPENINGS):
            page = window.new_page(viewport={"width": 1400, "height": 900})
            page.goto(file.as_uri())
            page.wait_for_selector("body[data-drawn]")
            found.append(page.evaluate(TIMES))
            page.close()
        window.close()
    return found


def main() -> None:
    """Print size and times."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--side", type=int, default=100, help="runs along each of two axes")
    parser.add_argument("--file", type=Path, help="open this report instead of making one")
    parser.add_argument("--browser", default=shutil.which("chromium") or "chromium")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        file = options.file or write_report(options.side, Path(folder))
        times = opening_times(file.resolve(), options.browser)
        print(f"size {file.stat().st_size / 1e6:.1f} MB")
    for name, text in (("parsed", "DOMContentLoaded"), ("drawn", "first plot drawn")):
        values = [each[name] / 1e3 for each in times]
        print(f"{text}: median {statistics.median(values):.2f} s, least {min(values):.2f} s, of {len(values)}")


if __name__ == "__main__":
    main()
