"""The quadrotor: the first system, its scenario files, flags and presets."""
