"""Many runs over axes: designs, the store of their rows, sensitivity, figures."""
