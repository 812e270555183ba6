"""Tracing: a slave's Python is run on symbols, along all paths, which gives statements over its memory."""
