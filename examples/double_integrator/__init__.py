"""A double integrator under state feedback: the smallest loop with a known largest sampling period."""
