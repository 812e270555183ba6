"""What happens when, without any FMU: the timetable, and what of it is drawn at random."""
