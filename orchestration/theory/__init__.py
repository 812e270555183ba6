"""What is computed without simulating: linear loops, exact costs, certificates."""
