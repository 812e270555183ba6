"""What rows come to: objectives, their units, the names that people read."""
