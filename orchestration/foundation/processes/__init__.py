"""Child processes, forked from one that has imported their module: messages, limits, and how they ended."""
