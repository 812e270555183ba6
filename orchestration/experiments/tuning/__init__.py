"""Tuning: searches for the parameters of a controller with the lowest cost."""
