"""The largest value of a quantity that is still good."""
