"""What can be asked to run: a system, a scenario, an SSP (`ssp/`); ranges of a quantity."""
