"""Creates folders for users' own slaves: a controller, a plant, a filter."""
