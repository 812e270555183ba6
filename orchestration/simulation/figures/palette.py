"""Colours that are safe for colour-blind readers (Okabe and Ito, 2008), for figures."""

BLUE, ORANGE, GREEN, RED = "#0072b2", "#e69f00", "#009e73", "#d55e00"
PURPLE, SKY, BROWN, GREY, BLACK = "#b0568c", "#56b4e9", "#7a5c1e", "#8a8a8a", "#222222"
VIOLET, INDIGO, PALE_GREEN = "#5b3f8f", "#5b4a8a", "#8ecf9b"
UMBER, SAND, CHARCOAL, SILVER = "#6f4f28", "#c9a66b", "#3a3a3a", "#b0b0b0"

CYCLE = (BLUE, RED, GREEN, ORANGE, PURPLE, SKY, BROWN, GREY)
"""Colours of lines of one kind in turn: neighbours differ in brightness too"""
MAX_LINES = len(CYCLE)
"""Most lines in one panel; more get further panels"""
MAX_PANELS = 24
"""Most panels of signals at first sight: a page or figure of more takes long and says little"""
DASHES = ("-", "--", "-.", ":")
"""Dashes of overlaid lines, so that they differ in grey print too"""
MARKS = ("o", "s", "D", "^", "v", "P", "X", "*")
"""Marks of points, likewise"""
SHADES = "viridis"
"""Colour map of values: perceptually uniform, also in grey"""
NOT_GOOD, DIVERGED = "#d9d9d9", "#6e6e6e"
"""Colours of outcomes on a map"""
CONTINUOUS, SAMPLED, SOURCE, LINE = "#dcebf5", "#fbe6d0", "#ececec", "#444444"
"""Colours of a block diagram: boxes by their kind, and arrows"""
