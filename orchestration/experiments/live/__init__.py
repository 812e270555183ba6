"""One HTML file in which a system runs while its numbers are changed."""
