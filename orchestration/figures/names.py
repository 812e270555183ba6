"""Names of formats, widths and styles, available without importing matplotlib."""

FORMATS = ("png", "svg", "pdf")
WRITTEN = ("png", "svg")
"""Default formats of figures"""
COLUMNS = {"single": 88.9, "double": 181.0}
"""Widths of journals [mm]: 3.5 and 7.13 inches"""
STYLES = ("screen", "paper", "slides")
