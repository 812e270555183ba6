"""Names within an SSP that third-party tools need."""

PARAMETER_SET = "scenario"
"""Name of each parameter set."""
SYSTEM_PARAMETERS = "resources/scenario.ssv"
"""The set with the parameters of all components, their names prefixed."""
