"""The C that every slave has: headers, the functions of FMI 2.0 and 3.0, and what a microcontroller has instead."""

from pathlib import Path

FOLDER = Path(__file__).parent
"""Where it lies"""
