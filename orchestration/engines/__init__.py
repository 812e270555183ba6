"""Steps components through the instants of a run: what happens when, and the master that obeys it."""
