"""A cascade of loops, each at its own rate, with the structure and the defaults of PX4.

`PX4` is the commit of PX4-Autopilot with that structure and those defaults; no code is taken from it.
"""

PX4 = "6ea3539157ca358c70a515878b77077af7d4611d"
"""PX4-Autopilot v1.16.0"""
