"""Checks of FMUs (`validation/`), and what they need to load (`doctor/`)."""
