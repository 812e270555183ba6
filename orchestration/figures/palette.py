"""Colours that are safe for colour-blind readers (Okabe and Ito, 2008), for figures."""

BLUE, ORANGE, GREEN, RED = "#0072b2", "#e69f00", "#009e73", "#d55e00"
PURPLE, SKY, BROWN, GREY, BLACK = "#b0568c", "#56b4e9", "#7a5c1e", "#8a8a8a", "#222222"

CYCLE = (BLUE, RED, GREEN, ORANGE, PURPLE, SKY, BROWN, GREY)
"""For lines of one kind in turn: neighbours differ in brightness too"""
DASHES = ("-", "--", "-.", ":")
"""Of overlaid lines, so that they differ in grey print too"""
MARKS = ("o", "s", "D", "^", "v", "P", "X", "*")
"""Of points, likewise"""
SHADES = "viridis"
"""For values: perceptually uniform, also in grey"""
NOT_GOOD, DIVERGED = "#d9d9d9", "#6e6e6e"
"""Of outcomes on a map"""
