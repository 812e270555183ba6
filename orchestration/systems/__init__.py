"""What is connected to what, and when what happens: descriptions, signals, clocks, processors, buses.

In: TOML tables. Out: a system as frozen records, checked against its FMUs, and the timetable of its instants; nothing
here steps an FMU.
Begin with `system/model.py`, what a system is, and `schedule/timetable.py`, when what happens. `expressions/` is the
language of objectives and criteria, `signals/` what drives inputs, `computers/` the scheduler of tasks and frames.
"""
