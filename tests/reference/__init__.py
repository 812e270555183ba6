"""An independent implementation of law and vehicle: the source of the tables in `tests/data`."""
