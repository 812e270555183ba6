"""The requirements of an FMU for loading, read from its file, compared with this machine."""
