"""Names within an SSP that other people's tools ask for."""

PARAMETER_SET = "scenario"
"""Name of each parameter set."""
SYSTEM_PARAMETERS = "resources/scenario.ssv"
"""The set with the names of the components before those of the parameters."""
