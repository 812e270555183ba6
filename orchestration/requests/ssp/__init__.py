"""Systems as SSP 1.0 files: written for other people's tools, and read with what SSP does not know on top."""
