"""The quadrotor, which no other district knows: its scenarios and the analysis of its flights.

In: a scenario file or flags. Out: a system of two FMUs, and figures, layouts and linear loops of its flights.
Begin with `scenarios/scenario.py`, what a scenario is, and `scenarios/system.toml`, the system that it becomes.
`flight/__init__.py` registers in six tables of lower districts what they would otherwise have to know of this vehicle.
"""
