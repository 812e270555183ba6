"""Many runs that answer a question: sweeps, limits, comparisons, tuning, and their report."""
