"""What steps components through the instants of a run: the master, in Python and in C, and runs as lanes."""
