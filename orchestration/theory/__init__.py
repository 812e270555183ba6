"""What is computed without simulating: linear loops, exact costs, certificates.

In: a system, whose FMUs are only asked for their answer to small inputs about rest. Out: the matrices of a period,
eigenvalues, expected costs, and proofs, each of which its own checker accepts.
Begin with `stability/period_map.py`, the linear map of one period of the schedule; `exact/` takes expectations over
what is random in it, `certificates/` bounds whatever the timing does.
"""
