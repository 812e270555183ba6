"""Where FMUs are, and the building of those that are old."""
