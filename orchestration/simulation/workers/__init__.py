"""Worker processes, here or by dask: their tasks, the engine they take, and what the bits of a run depend on."""
