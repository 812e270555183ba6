"""What is wrong with an FMU, and what it needs."""
