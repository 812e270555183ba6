"""Loops linearised about rest: local limits, margins."""
