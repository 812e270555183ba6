"""A report: runs, a study or a comparison as one HTML file that needs nothing else, also no network."""
