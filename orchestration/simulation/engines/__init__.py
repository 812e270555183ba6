"""Engines step components through the instants of a run: in Python, in C, and many runs in SIMD lanes (`batch/`)."""
