"""Many runs that answer a question: sweeps, limits, comparisons, tuning, and their report.

In: a file that says what varies, or a request and a quantity. Out: a store of rows, a table, a figure, one number.
Begin with `studies/sweep.py`: it lists the runs, has workers simulate those that are missing, and keeps their rows in
`studies/store.py`. The others ask the same workers: `limits/limit.py`, `comparison/run.py`, `tuning/tune.py`.
"""
