"""The timetable of a run, without any FMU: its instants, regular and random."""
