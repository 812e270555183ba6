"""The quadrotor as a rigid body, and its FMU."""
