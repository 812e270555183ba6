"""Sampled redesigns of a law, and a predictor for a known delay, for any law that is a pure function."""
