"""The command line `quadcosim`.

In: the words of a command line. Out: a document (`--json`) or lines, files, and an exit code.
Begin with `start.py`, which runs; `cli.py` lists the commands, and each has its file, as `run.py`. A command loads what
it needs when it is called, and computes nothing itself: it asks the districts below.
"""
