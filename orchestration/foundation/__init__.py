"""What everything stands on: processes, errors, documents, units, records of rows and events.

Knows neither FMUs nor systems: each module here could stand in another project.
Begin with `basics/errors.py`, the two kinds of errors that users see; `processes/child.py`, a child process with its
limits and its end; `recording/recording.py`, the rows and events of a run.
"""
