"""Child processes: how they are started, and held to limits of time and memory."""
