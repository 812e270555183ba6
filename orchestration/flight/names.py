"""Names by which a flight is known elsewhere."""

KIND = "flight"
"""That of a `Scenario`"""
FIGURES = ("path", "errors", "components", "commands", "energy", "phase", "spectrum")
