"""The words in which objectives and criteria are written: parsed once, and written for each that evaluates them."""
