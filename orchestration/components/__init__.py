"""FMUs one by one: read, run, built, checked."""
