"""From a request to a result: one run, its directory, its pause, its figures by name."""
