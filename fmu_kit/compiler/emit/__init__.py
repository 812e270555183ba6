"""Generated code of a traced slave: C for an FMU, for SIMD lanes, for a microcontroller; tables; FMI descriptions."""
