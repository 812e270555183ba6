"""The same system in third-party masters."""
