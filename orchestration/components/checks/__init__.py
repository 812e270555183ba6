"""The problems of an FMU, and its requirements."""
