"""The words in which objectives and criteria are written: parsed once, evaluated without Python's own evaluator."""
