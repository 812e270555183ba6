"""A slave's Python run on symbols: statements, memory, and the paths that it can take."""
