"""Whole studies as lanes of runs in vector registers: what the engine `batch` flies by."""
