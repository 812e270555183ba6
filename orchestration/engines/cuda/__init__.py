"""Runs in threads of a GPU, one in each: the text of lanes as CUDA, what compiles it and what flies it."""
