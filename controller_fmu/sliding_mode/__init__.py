"""The unified (not time-scale-separated) finite-time sliding-mode controller."""
