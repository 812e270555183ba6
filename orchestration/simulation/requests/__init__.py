"""Requests to run: a system, a scenario, an SSP."""
