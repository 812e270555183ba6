"""This vehicle alone: scenario files, its system file, presets, initial conditions, `vehicles/`."""
