"""From a request to its result: engines, objectives, figures, runs, workers, other masters.

In: a request (a system, a scenario, an SSP). Out: a result: rows, events, objectives, an outcome, a directory.
Begin with `runs/simulation.py`, one run from start to end; `engines/instants.py` says what happens at an instant, in
Python, and `engines/loop.c` in C. `workers/` does many runs, `interop/` the same run in third-party masters.
"""
