"""From a request to a result, its directory and its figures."""
