"""FMUs as simulators: what their descriptions say, and instances of them, of FMI 2.0 and 3.0."""
