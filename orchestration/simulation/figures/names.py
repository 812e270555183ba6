"""Names of formats, widths and styles, available without importing matplotlib."""

from pathlib import Path

from orchestration.foundation.basics.errors import UsageError

FORMATS = ("png", "svg", "pdf")
WRITTEN = ("png", "svg")
"""Default formats of figures"""
COLUMNS = {"single": 88.9, "double": 181.0}
"""Widths of journals [mm]: 3.5 and 7.13 inches"""
STYLES = ("screen", "paper", "slides")


def expect_figure(path: Path) -> None:
    """Raise `UsageError` for an `--out` whose ending is not one of `FORMATS`."""
    if path.suffix[1:] not in FORMATS:
        raise UsageError(f"--out {path}: expected a figure ending in one of {', '.join(FORMATS)}")
