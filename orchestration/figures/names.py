"""Names of formats, for whoever has to know them without drawing."""

FORMATS = ("png", "svg", "pdf")
WRITTEN = ("png", "svg")
"""Formats of every figure for which none is asked"""
COLUMNS = {"single": 88.9, "double": 181.0}
"""Widths of journals [mm]: 3.5 and 7.13 inches"""
STYLES = ("screen", "paper", "slides")
