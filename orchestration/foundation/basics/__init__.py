"""Basics for every package: errors, units, documents, terminal, progress, statistics, the protocol of simulators."""
