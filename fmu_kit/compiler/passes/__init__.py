"""Transformations of programs: derivatives, precomputing of parameters, and a step as straight-line code."""
