"""What any room may need: errors, units, documents, the terminal, progress, statistics, what a simulator is."""
