"""From statements to statements: derivatives, what follows from parameters alone, and a step as one straight line."""
