"""The engine `cuda`: many runs at once, one in each thread of a GPU, by the C for SIMD lanes compiled as CUDA."""
