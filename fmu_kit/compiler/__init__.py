"""Slaves without Python inside: run on symbols, and written out as C."""
