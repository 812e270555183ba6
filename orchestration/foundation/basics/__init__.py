"""Errors, units, documents, the terminal, progress, statistics, bisection."""
