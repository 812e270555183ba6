"""What is connected to what, and when what happens: descriptions, signals, clocks, processors, buses."""
