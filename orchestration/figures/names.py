"""Names of figures and formats, for whoever has to know them without drawing."""

FLIGHT = ("path", "errors", "components", "commands", "energy", "phase", "spectrum")
"""Figures of a flight of the quadrotor"""
SYSTEM = ("signals",)
"""of any other system"""
FIRST = ("path", "errors", "components", "commands", *SYSTEM)
"""Those that a run draws at once; all others when they are asked for"""
FORMATS = ("png", "svg", "pdf")
COLUMNS = {"single": 88.9, "double": 181.0}
"""Widths of journals [mm]: 3.5 and 7.13 inches"""
STYLES = ("screen", "paper", "slides")

FILES = frozenset(f"{name}.{ending}" for name in (*FLIGHT, *SYSTEM) for ending in FORMATS)
"""What may be in the directory of a run"""
