"""Child processes: messages to and from them, their limits, and how they ended."""
