"""Whole studies as lanes of runs in vector registers: what `sweep --engine batch` flies by."""
