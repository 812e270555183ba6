"""Controllers compared from the same initial conditions: survival, settling, limits, error and effort."""
