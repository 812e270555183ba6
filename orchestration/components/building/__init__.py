"""Finds FMUs, and builds those that are out of date."""
