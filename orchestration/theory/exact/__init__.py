"""Exact answers for linear loops under random timing: expected costs, mean-square radii and limits."""
