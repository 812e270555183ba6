"""Engines step components through the instants of a run: the master in Python and in C, and runs in SIMD lanes."""
