"""Many runs of one request, over axes of timing, parameters and initial state."""
