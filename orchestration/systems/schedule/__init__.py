"""What happens when, without any FMU: the timetable, random timing, streams of random numbers."""
