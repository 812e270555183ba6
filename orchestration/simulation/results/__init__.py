"""The metrics of a run, their units, and display names."""
