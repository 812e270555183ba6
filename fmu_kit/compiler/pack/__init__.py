"""Packaging: C compilers, archives, the hash of the sources, libraries for SIMD lanes."""
