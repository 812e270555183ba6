"""Who has a processor or a network when: a scheduler in integer nanoseconds, which knows no FMU and no file."""
