"""Sampled redesigns of a law, and a predictor for a known delay: over any law that is a pure function."""
