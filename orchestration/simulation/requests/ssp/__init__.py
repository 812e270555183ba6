"""Systems as SSP 1.0 files: written for third-party tools, and read with a file of timing, which SSP lacks."""
