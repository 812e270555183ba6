"""The language of objectives and criteria: its parser, and its evaluation over runs and at instants."""
