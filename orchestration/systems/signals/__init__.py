"""Signals that drive inputs: tables, motions by name, way-points, gusts."""

WINDS = ("dryden",)
"""Names of signals that are wind along north, east and down; the others are motions."""
