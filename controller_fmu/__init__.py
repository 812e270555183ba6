"""The unified (not time-scale-separated) finite-time sliding-mode controller, and its FMU."""
