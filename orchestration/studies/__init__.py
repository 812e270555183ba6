"""Studies: many runs of one scenario, over axes of timing, parameters and initial state."""
