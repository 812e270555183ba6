"""FMUs one by one: read, run, built, checked.

In: an FMU's file, or the folder of its sources. Out: its description, a running instance, a new file, or findings.
Begin with `fmi/read_description.py`, what an FMU declares, and `fmi/instance.py`, what can be asked of one that runs:
natively, in this process or in one of its own. `building/` finds and builds, `checks/` validates, `scaffold/` writes
new folders.
"""
