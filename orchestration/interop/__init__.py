"""The same system by other people's masters."""
