"""What an FMU needs to load, read from its file, and what of it this machine has."""
