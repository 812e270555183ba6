"""Colours that people with colour-blindness tell apart (Okabe and Ito, 2008), for figures and pages alike."""

BLUE, ORANGE, GREEN, RED = "#0072b2", "#e69f00", "#009e73", "#d55e00"
PURPLE, SKY, BROWN, GREY, BLACK = "#b0568c", "#56b4e9", "#7a5c1e", "#8a8a8a", "#222222"

CYCLE = (BLUE, RED, GREEN, ORANGE, PURPLE, SKY, BROWN, GREY)
"""One after the other for lines of one kind: neighbours differ in brightness too"""
DASHES = ("-", "--", "-.", ":")
"""Of lines that are laid over each other, so that a print in grey still tells them apart"""
MARKS = ("o", "s", "D", "^", "v", "P", "X", "*")
"""Of points, likewise"""
SHADES = "viridis"
"""For values: uniform to the eye, and in grey"""
NOT_GOOD, DIVERGED = "#d9d9d9", "#6e6e6e"
"""Of outcomes on a map"""
