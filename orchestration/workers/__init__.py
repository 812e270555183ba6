"""Processes that fly runs: a pool here, dask elsewhere, and what they are told."""
