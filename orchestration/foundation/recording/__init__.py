"""Rows and events of a run, in memory and in files."""
