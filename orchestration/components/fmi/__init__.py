"""FMUs as simulators: their model descriptions, and instances of them, of FMI 2.0 and 3.0."""
