"""Finds FMUs, and builds those that are missing or out of date."""
