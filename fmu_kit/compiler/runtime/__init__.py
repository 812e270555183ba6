"""The C that all slaves share: headers, the functions of FMI 2.0 and 3.0, and templates for microcontrollers."""

from pathlib import Path

FOLDER = Path(__file__).parent
"""The folder of these files"""
