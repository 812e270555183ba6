"""Worker processes that simulate runs: a local pool or dask, and the tasks sent to them."""
