"""A proved basin of attraction of the quadrotor in its lateral plane: `python -m docs.lateral_basin 0.01`."""
