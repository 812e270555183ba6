"""From statements to statements: derivatives, and what follows from parameters alone."""
