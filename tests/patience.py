"""How long tests wait for another process: a hundredfold of what the slowest takes, for a machine may be busy."""

PATIENCE = 6000.0
"""[s]: it stops what hangs, and measures nothing"""
