"""Figures of rows: style, axes, lines; without knowing what a run is."""
