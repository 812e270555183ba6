"""What a run came to: objectives, tables, figures."""
