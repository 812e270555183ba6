"""FMUs as simulators: descriptions and instances of FMI 1.0, 2.0 and 3.0, in this process or one of their own."""
