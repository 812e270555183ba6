"""The quadrotor, which no other district knows: its scenarios and the analysis of its flights."""
