"""Worker processes, here or by dask: their tasks, their engine, what bits depend on; runs from arrays into arrays."""
