"""The engine `batch`: many runs at once, one in each SIMD lane."""
