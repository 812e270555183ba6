"""Other tools: files that they read, and their masters."""
