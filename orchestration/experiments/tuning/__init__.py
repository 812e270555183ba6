"""Searches for the parameters of a controller that cost least."""
