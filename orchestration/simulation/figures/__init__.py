"""Figures of recorded rows: style, axes, lines; independent of what a run is."""
