"""From a request to its result: engines, objectives, figures, runs, workers, other masters."""
