"""The command `quadcosim`."""
