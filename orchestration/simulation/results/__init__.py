"""Results of rows: objectives, units, display names."""
