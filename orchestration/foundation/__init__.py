"""What everything stands on: processes, errors, documents, units, records of rows and events."""
