"""The scheduler of processors and networks, in integer nanoseconds, without FMUs or files; and bounds of theory."""
