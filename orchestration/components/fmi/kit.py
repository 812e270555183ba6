"""Names of the parameters of FMUs built on `fmu_kit` that set when they sample and what they follow."""

SAMPLE_PERIOD, SAMPLE_OFFSET = "sample_period", "sample_offset"
"""Parameters of a component's own clock; with period 0 it samples at every step from the offset on"""
TRAJECTORY = {f"trajectory.{name}": name for name in ("amplitude_x", "amplitude_y", "frequency", "start_z", "rate_z")}
"""Parameters of a component's built-in trajectory, with the matching fields of `fmu_kit.trajectory.Trajectory`"""
USE_REFERENCE_INPUTS = "use_reference_inputs"
"""Parameter of a component with such a trajectory: whether it follows its inputs instead"""
